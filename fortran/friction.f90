!> Amontons-Coulomb friction: the force in a given contact state, and the change of that state at a step's end.
module pyfric_friction
  use pyfric_kinds, only: dp, ip
  use pyfric_model, only: model_t, LB, LANES
  implicit none (type, external)
  private
  public :: friction_force, stop_reversed, next_mode, slip, STUCK, OPEN_GAP

  !> Contact states; slipping blocks carry the sign of their motion, +1 or -1.
  integer(ip), parameter :: STUCK = 0, OPEN_GAP = 2

contains

  !> Stuck: f balances all other horizontal forces. Slipping: mu p against the motion. Open: none.
  !>
  !>   mu = mu_s - (mu_s - mu_k) min(s/d_c, 1), s the slip since the last stick; mu_k without weakening (d_c = 0)
  pure subroutine friction_force(s, mode, s_0, u_x, other, p, f)
    type(model_t), intent(in) :: s
    integer(ip), intent(in) :: mode(s%nx)  !! contact states
    real(dp), intent(in) :: s_0(s%nx)      !! see `slip` [m]
    real(dp), intent(in) :: u_x(LB:s%n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: other(LB:s%n + LANES)  !! all other horizontal forces, as a row [N]
    real(dp), intent(in) :: p(s%nx)        !! foundation force [N]
    real(dp), intent(out) :: f(s%nx)       !! friction force on the blocks, along +x [N]
    real(dp) :: mu
    integer :: i

    do i = 1, s%nx
      select case (mode(i))
      case (STUCK)
        f(i) = -other(s%at(i))
      case (OPEN_GAP)
        f(i) = 0.0_dp
      case default
        mu = max(s%mu_k, min(s%mu_0, s%mu_0 - s%drop*slip(mode(i), s_0(i), u_x(s%at(i)))))
        f(i) = -real(mode(i), dp)*(mu*p(i))
      end select
    end do
  end subroutine friction_force

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

  !> The contact state after a step (the paper's rule). A block at rest sticks up to mu_s p; beyond, it slips
  !> where the other forces pull it. A block that lands slips along its velocity.
  pure elemental function next_mode(mu_s, other, p, mode, v_x) result(new)
    real(dp), intent(in) :: mu_s     !! static friction coefficient [-]
    real(dp), intent(in) :: other    !! all other horizontal forces [N]
    real(dp), intent(in) :: p        !! foundation force [N]
    integer(ip), intent(in) :: mode  !! contact state
    real(dp), intent(in) :: v_x      !! velocity [m/s]
    integer(ip) :: new

    if (p <= 0.0_dp) then
      new = OPEN_GAP
    else if (v_x == 0.0_dp .and. abs(other) <= mu_s*p) then
      new = STUCK
    else if (v_x == 0.0_dp) then
      new = merge(1_ip, -1_ip, other > 0.0_dp)
    else if (mode == OPEN_GAP) then
      new = merge(1_ip, -1_ip, v_x > 0.0_dp)
    else
      new = mode
    end if
  end function next_mode
end module pyfric_friction
