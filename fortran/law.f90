!> The friction law, Amontons-Coulomb: the only module that knows its coefficients and the slip clock.
!>
!> It says what a stuck and a slipping block bear, what a switch does to a block's memory, which margins of a contact
!> state stay positive while it lasts, and which contact state comes next.
module pyfric_law
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: LB, LANES
  implicit none (type, external)
  private
  public :: law_constants_t, law_t, new_law, friction_force, margins, stop_reversed, next_states, remembered
  public :: STUCK, OPEN_GAP

  !> Contact states; slipping blocks carry the sign of their motion, +1 or -1.
  integer(ip), parameter :: STUCK = 0, OPEN_GAP = 2

  !> What Python passes, in this order; the same names are in pyfric.core.Constants.
  type, bind(c) :: law_constants_t
    real(dp) :: mu_s        !! static friction coefficient [-]
    real(dp) :: mu_k        !! kinetic friction coefficient [-]
    real(dp) :: d_c         !! slip over which mu_s falls to mu_k, 0 for at once [m]
  end type law_constants_t

  type :: law_t
    private
    real(dp) :: mu_s        !! static friction coefficient [-]
    real(dp) :: mu_k        !! kinetic friction coefficient [-]
    real(dp) :: mu_0        !! friction coefficient where slip begins: mu_s, or mu_k without weakening [-]
    real(dp) :: drop        !! its loss per slip, (mu_s - mu_k)/d_c, or 0 without weakening [1/m]
  end type law_t

contains

  pure function new_law(c) result(law)
    type(law_constants_t), intent(in) :: c
    type(law_t) :: law

    law%mu_s = c%mu_s
    law%mu_k = c%mu_k
    law%mu_0 = merge(c%mu_s, c%mu_k, c%d_c > 0.0_dp)
    law%drop = 0.0_dp
    if (c%d_c > 0.0_dp) law%drop = (c%mu_s - c%mu_k)/c%d_c
  end function new_law

  !> Stuck: f balances all other horizontal forces. Slipping: mu p against the motion. Open: none.
  pure subroutine friction_force(law, nx, n, at, mode, s_0, u_x, other, p, f)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: s_0(nx)              !! see `slip` [m]
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: other(LB:n + LANES)  !! all other horizontal forces, as a row [N]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(out) :: f(nx)               !! friction force on the blocks, along +x [N]
    integer :: i

    do i = 1, nx
      select case (mode(i))
      case (STUCK)
        f(i) = -other(at(i))
      case (OPEN_GAP)
        f(i) = 0.0_dp
      case default
        f(i) = -real(mode(i), dp)*slipping_strength(law, p(i), slip(mode(i), s_0(i), u_x(at(i))))
      end select
    end do
  end subroutine friction_force

  !> mu_s p: what a stuck block bears [N].
  pure elemental function stuck_strength(law, p) result(most)
    type(law_t), intent(in) :: law
    real(dp), intent(in) :: p        !! foundation force [N]
    real(dp) :: most

    most = law%mu_s*p
  end function stuck_strength

  !> mu p with mu = mu_s - (mu_s - mu_k) min(s/d_c, 1), or mu_k without weakening (d_c = 0) [N].
  pure elemental function slipping_strength(law, p, path) result(force)
    type(law_t), intent(in) :: law
    real(dp), intent(in) :: p        !! foundation force [N]
    real(dp), intent(in) :: path     !! slip s since the last stick [m]
    real(dp) :: force

    force = max(law%mu_k, min(law%mu_0, law%mu_0 - law%drop*path))*p
  end function slipping_strength

  !> Slip since the last stick, s = s_0 +- u_x: within a step it follows the displacement of each stage. The stepper
  !> keeps its order, except for a step in which s reaches d_c, where mu(s) has a corner: second order.
  pure elemental function slip(mode, s_0, u_x) result(path)
    integer(ip), intent(in) :: mode  !! contact state
    real(dp), intent(in) :: s_0      !! set when the contact state changes; the slip itself while the block is open [m]
    real(dp), intent(in) :: u_x      !! displacement [m]
    real(dp) :: path

    path = s_0
    if (abs(mode) == 1) path = s_0 + real(mode, dp)*u_x
  end function slip

  !> What a switch does to a block's memory s_0: slip starts at 0 after a stick, and otherwise goes on.
  pure elemental function remembered(old, new, s_0, u_x) result(memory)
    integer(ip), intent(in) :: old   !! contact state before
    integer(ip), intent(in) :: new   !! contact state after
    real(dp), intent(in) :: s_0      !! memory before, see `slip` [m]
    real(dp), intent(in) :: u_x      !! displacement [m]
    real(dp) :: memory

    memory = slip(old, s_0, u_x)
    if (new == STUCK) memory = 0.0_dp
    memory = slip(new, memory, -u_x)
  end function remembered

  !> mu_s p - |f|: what a stuck block can bear besides; negative, it slips [N].
  pure elemental function stuck_margin(law, other, p) result(margin)
    type(law_t), intent(in) :: law
    real(dp), intent(in) :: other    !! all other horizontal forces [N]
    real(dp), intent(in) :: p        !! foundation force [N]
    real(dp) :: margin

    margin = stuck_strength(law, p) - abs(other)
  end function stuck_margin

  !> What stays positive while a contact state lasts. Stuck: mu_s p - |f|; slipping: the velocity along the slip; both:
  !> the depth. Open: the height, twice.
  pure subroutine margins(law, nx, n, at, mode, other, p, u_z, v_x, g, bears)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: other(LB:n + LANES)  !! all other horizontal forces, as a row [N]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: u_z(LB:n + LANES)    !! heights, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(out) :: g(2, nx)            !! of friction [N] or [m/s], of the gap [m]
    real(dp), intent(out) :: bears(nx)           !! of friction if the block were stuck [N]
    integer :: i

    do i = 1, nx
      bears(i) = stuck_margin(law, other(at(i)), p(i))
      g(2, i) = -u_z(at(i))
      select case (mode(i))
      case (STUCK)
        g(1, i) = bears(i)
      case (OPEN_GAP)
        g(:, i) = u_z(at(i))
      case default
        g(1, i) = real(mode(i), dp)*v_x(at(i))
      end select
    end do
  end subroutine margins

  !> Ends the motion of blocks that no longer move the way they slip; the energy that goes is the switching loss.
  pure elemental subroutine stop_reversed(m, p, mode, v_x, loss)
    real(dp), intent(in) :: m        !! block mass [kg]
    real(dp), intent(in) :: p        !! foundation force [N]
    integer(ip), intent(in) :: mode  !! contact state
    real(dp), intent(inout) :: v_x   !! velocity [m/s]
    real(dp), intent(inout) :: loss  !! kinetic energy removed so far [J]

    if (abs(mode) == 1 .and. p > 0.0_dp .and. real(mode, dp)*v_x <= 0.0_dp) then
      loss = loss + 0.5_dp*m*v_x**2
      v_x = 0.0_dp
    end if
  end subroutine stop_reversed

  !> The contact states after a step, and what each block could bear besides if it were stuck.
  pure subroutine next_states(law, nx, n, at, mode, other, p, v_x, new, margin)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: other(LB:n + LANES)  !! all other horizontal forces, as a row [N]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    integer(ip), intent(out) :: new(nx)          !! contact states after
    real(dp), intent(out) :: margin(nx)          !! [N]
    integer :: i

    do i = 1, nx
      margin(i) = stuck_margin(law, other(at(i)), p(i))
      new(i) = next_state(law, other(at(i)), p(i), mode(i), v_x(at(i)))
    end do
  end subroutine next_states

  !> The paper's rule for one block. A block at rest sticks up to mu_s p; beyond, it slips
  !> where the other forces pull it. A block that lands slips along its velocity.
  pure elemental function next_state(law, other, p, mode, v_x) result(new)
    type(law_t), intent(in) :: law
    real(dp), intent(in) :: other    !! all other horizontal forces [N]
    real(dp), intent(in) :: p        !! foundation force [N]
    integer(ip), intent(in) :: mode  !! contact state
    real(dp), intent(in) :: v_x      !! velocity [m/s]
    integer(ip) :: new

    if (p <= 0.0_dp) then
      new = OPEN_GAP
    else if (v_x == 0.0_dp .and. abs(other) <= stuck_strength(law, p)) then
      new = STUCK
    else if (v_x == 0.0_dp) then
      new = merge(1_ip, -1_ip, other > 0.0_dp)
    else if (mode == OPEN_GAP) then
      new = merge(1_ip, -1_ip, v_x > 0.0_dp)
    else
      new = mode
    end if
  end function next_state
end module pyfric_law
