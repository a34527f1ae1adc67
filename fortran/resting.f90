!> Friction under which blocks come to rest: they stick up to a strength, and slip above this strength.
!>
!> A law consists of tables from Python, and is linear between the knots of tables. For block i, with slip s and age a (time since
!> the block stuck or began to slip),
!>
!>     stuck      |f| <= (mu_s + hold(a)) p
!>     slipping   f = -(+-1) (mu_k + (mu_s - mu_k) slide(s/d_c)) speed(|v|) age(a) p - alpha v
!>
!> A limit, linear in time within a piece of the protocols, bounds the factor of p in both lines. Without tables the law is
!> Amontons-Coulomb friction: hold = slide = 0, speed = age = 1.
module pyfric_resting
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: LB, LANES
  use pyfric_curve, only: curve_t, cell, at_x
  implicit none (type, external)
  private
  public :: resting_t, new_resting, forces, powers, event_functions, last_knots, knot_functions, time_to_knot
  public :: stop_reversed, next_states, remember
  public :: STUCK, OPEN_GAP, N_CONTACT, N_KNOT, N_MARK, N_TABLES, N_FIELDS

  !> Codes of contact states. Slipping blocks have the sign of their motion, +1 or -1. On junctions, a block is stuck while enough
  !> junctions are pinned; a block that ruptures gets the sign of its velocity. With rate-and-state friction, a block is stuck while
  !> it is slow.
  integer(ip), parameter :: STUCK = 0, OPEN_GAP = 2
  !> How many numbers each block has: event functions of a contact state; event functions of knots; marks of knots at the start of
  !> a sub-step.
  integer, parameter :: N_CONTACT = 2, N_KNOT = 3, N_MARK = 4
  !> Number of tables, and number of fields of N_x numbers, that Python passes.
  integer, parameter :: N_TABLES = 4, N_FIELDS = 7
  !> Indices of state variables of a block: s_0, see `slip_of` [m]; time at which the block stuck or began to slip [s].
  integer, parameter :: SLIP = 1, SINCE = 2, N_MEMORY = 2

  type :: resting_t
    logical :: complete = .false.      !! whether memory was allocated
    logical :: simple = .false.        !! whether the law has no tables, no viscosity and no limit
    logical :: kinked = .false.        !! whether friction over slip or speed has corners
    logical :: keeps = .false.         !! whether slip goes on after a stick
    logical :: limited = .false.       !! whether some blocks have a limit
    real(dp) :: t_0 = 0.0_dp           !! time at which `limit` holds [s]
    real(dp), allocatable :: mu_s(:)   !! static friction coefficient [-]
    real(dp), allocatable :: mu_k(:)   !! kinetic friction coefficient [-]
    real(dp), allocatable :: d_c(:)    !! unit of slip in `slide`; 0: friction drops at once [m]
    real(dp), allocatable :: alpha(:)  !! viscosity of slip [N s/m]
    logical, allocatable :: bare(:)    !! whether a block has no friction in contact; its state is then open
    real(dp), allocatable :: limit(:)  !! largest friction coefficient at t_0 [-]
    real(dp), allocatable :: limit_rate(:) !! rate of the limit [1/s]
    type(curve_t) :: hold              !! gain of mu_s as a function of time since the block stuck [s]
    type(curve_t) :: slide             !! remaining share of mu_s - mu_k as a function of slip/d_c
    type(curve_t) :: speed             !! factor of friction as a function of abs(v) [m/s]
    type(curve_t) :: age               !! factor of friction as a function of time since slip began [s]
  end type resting_t

contains

  pure function new_resting(nx, fields, tables, keeps, t_0) result(of)
    integer, intent(in) :: nx                          !! blocks
    real(dp), intent(in) :: fields(nx, N_FIELDS)       !! mu_s, mu_k, d_c, alpha, bare, limit, rate of the limit
    type(curve_t), intent(in) :: tables(N_TABLES)      !! hold, slide, speed, age
    logical, intent(in) :: keeps
    real(dp), intent(in) :: t_0
    type(resting_t) :: of
    integer :: failed

    allocate (of%mu_s(nx), of%mu_k(nx), of%d_c(nx), of%alpha(nx), of%bare(nx), of%limit(nx), of%limit_rate(nx), stat=failed)
    of%complete = failed == 0 .and. all(tables%complete)
    if (.not. of%complete) return
    of%mu_s(:) = fields(:, 1)
    of%mu_k(:) = fields(:, 2)
    of%d_c(:) = fields(:, 3)
    of%alpha(:) = fields(:, 4)
    of%bare(:) = fields(:, 5) > 0.0_dp
    of%limit(:) = fields(:, 6)
    of%limit_rate(:) = fields(:, 7)
    of%limited = any(of%limit < huge(1.0_dp))
    of%hold = tables(1)
    of%slide = tables(2)
    of%speed = tables(3)
    of%age = tables(4)
    of%keeps = keeps
    of%t_0 = t_0
    of%kinked = of%slide%n > 0 .or. of%speed%n > 0
    of%simple = all(tables%n == 0) .and. all(of%alpha <= 0.0_dp) .and. .not. of%limited
  end function new_resting

  !> Friction forces. Stuck: f balances all other horizontal forces. Slipping: mu p against the motion, and -alpha v. Open: none.
  pure subroutine forces(of, nx, n, at, mode, memory, t, u_x, v_x, other, p, f)
    type(resting_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(N_MEMORY, nx)
    real(dp), intent(in) :: t                    !! time [s]
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: other(LB:n + LANES)  !! all other horizontal forces, as a row [N]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(out) :: f(nx)               !! friction force on the blocks, along +x [N]
    real(dp) :: mu
    integer :: i

    do i = 1, nx
      select case (mode(i))
      case (STUCK)
        f(i) = -other(at(i))
      case (OPEN_GAP)
        f(i) = 0.0_dp
      case default
        f(i) = -real(mode(i), dp)*(of%mu_k(i)*p(i))
      end select
    end do
    if (of%simple) return
    do i = 1, nx
      if (abs(mode(i)) /= 1) cycle
      mu = sliding(of, i, slip_of(mode(i), memory(SLIP, i), u_x(at(i))), v_x(at(i)), t - memory(SINCE, i))
      if (of%limited) mu = min(mu, limit_at(of, i, t))
      f(i) = -real(mode(i), dp)*(mu*p(i)) - of%alpha(i)*v_x(at(i))
    end do
  end subroutine forces

  !> mu of a slipping block, from its slip [m], its velocity [m/s] and the time since slip began [s].
  pure function sliding(of, i, path, v, age) result(mu)
    type(resting_t), intent(in) :: of
    integer, intent(in) :: i
    real(dp), intent(in) :: path
    real(dp), intent(in) :: v
    real(dp), intent(in) :: age
    real(dp) :: mu, remaining

    mu = of%mu_k(i)
    if (of%slide%n > 0) then
      remaining = of%slide%y(of%slide%n)
      if (of%d_c(i) > 0.0_dp) remaining = at_x(of%slide, path/of%d_c(i))
      mu = mu + (of%mu_s(i) - mu)*remaining
    end if
    if (of%speed%n > 0) mu = mu*at_x(of%speed, abs(v))
    if (of%age%n > 0) mu = mu*at_x(of%age, age)
  end function sliding

  !> Largest friction coefficient of a block at time t [s].
  pure function limit_at(of, i, t) result(mu)
    type(resting_t), intent(in) :: of
    integer, intent(in) :: i
    real(dp), intent(in) :: t
    real(dp) :: mu

    mu = max(of%limit(i) + of%limit_rate(i)*(t - of%t_0), 0.0_dp)
  end function limit_at

  !> Friction power above mu_k p, and power of alpha.
  pure subroutine powers(of, nx, n, at, mode, v_x, p, f, above, viscous)
    type(resting_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: f(nx)                !! friction force on the blocks, along +x [N]
    real(dp), intent(out) :: above(nx)           !! friction power above the kinetic strength [W]
    real(dp), intent(out) :: viscous(nx)         !! power of alpha [W]
    real(dp) :: v
    integer :: i

    above = 0.0_dp
    viscous = 0.0_dp
    do i = 1, nx
      if (abs(mode(i)) /= 1) cycle
      v = v_x(at(i))
      viscous(i) = of%alpha(i)*v*v
      above(i) = -(f(i) + of%alpha(i)*v + real(mode(i), dp)*(of%mu_k(i)*p(i)))*v
    end do
  end subroutine powers

  !> Strength of a stuck block [N]. A block that has just stopped has age 0.
  pure function static_strength(of, i, mode, t_stuck, t, p) result(strength)
    type(resting_t), intent(in) :: of
    integer, intent(in) :: i
    integer(ip), intent(in) :: mode  !! contact state
    real(dp), intent(in) :: t_stuck  !! time at which the block stuck [s]
    real(dp), intent(in) :: t        !! time [s]
    real(dp), intent(in) :: p        !! foundation force [N]
    real(dp) :: strength

    if (of%hold%n == 0) then
      strength = of%mu_s(i)*p
    else
      strength = (of%mu_s(i) + at_x(of%hold, merge(t - t_stuck, 0.0_dp, mode == STUCK)))*p
    end if
    if (of%limited) strength = min(strength, limit_at(of, i, t)*p)
  end function static_strength

  !> Slip since the last stick, s = s_0 +- u_x, at the displacement u_x of a stage.
  pure elemental function slip_of(mode, s_0, u_x) result(path)
    integer(ip), intent(in) :: mode  !! contact state
    real(dp), intent(in) :: s_0      !! set when the contact state changes; equal to the slip while the block is open [m]
    real(dp), intent(in) :: u_x      !! displacement [m]
    real(dp) :: path

    path = s_0
    if (abs(mode) == 1) path = s_0 + real(mode, dp)*u_x
  end function slip_of

  !> Changes the state variables of a block at a switch. After a stick, slip and time start at 0; otherwise they go on. With
  !> `keeps`, slip always goes on.
  pure subroutine remember(of, old, new, t, u_x, memory)
    type(resting_t), intent(in) :: of
    integer(ip), intent(in) :: old   !! old contact state
    integer(ip), intent(in) :: new   !! new contact state
    real(dp), intent(in) :: t        !! time [s]
    real(dp), intent(in) :: u_x      !! displacement [m]
    real(dp), intent(inout) :: memory(N_MEMORY)

    memory(SLIP) = slip_of(old, memory(SLIP), u_x)
    if (new == STUCK .and. .not. of%keeps) memory(SLIP) = 0.0_dp
    memory(SLIP) = slip_of(new, memory(SLIP), -u_x)
    if (old == STUCK .or. new == STUCK) memory(SINCE) = t
  end subroutine remember

  !> Event functions, which are positive while a contact state lasts. Stuck: strength minus |f|, and depth in the foundation.
  !> Slipping: velocity along the slip, and depth. Open: the height, twice. Bare: none.
  pure subroutine event_functions(of, nx, n, at, mode, memory, t, other, p, z, v_x, g, margin)
    type(resting_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(N_MEMORY, nx)
    real(dp), intent(in) :: t                    !! time [s]
    real(dp), intent(in) :: other(LB:n + LANES)  !! all other horizontal forces, as a row [N]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: z(nx)                !! heights above the foundation [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(out) :: g(N_CONTACT, nx)    !! event functions of friction [N] or [m/s], and of the gap [m]
    real(dp), intent(out) :: margin(nx)          !! strength minus load if the block were stuck [N]
    integer :: i

    do i = 1, nx
      margin(i) = static_strength(of, i, mode(i), memory(SINCE, i), t, p(i)) - abs(other(at(i)))
      g(2, i) = -z(i)
      select case (mode(i))
      case (STUCK)
        g(1, i) = margin(i)
      case (OPEN_GAP)
        g(:, i) = merge(1.0_dp, z(i), of%bare(i))
      case default
        g(1, i) = real(mode(i), dp)*v_x(at(i))
      end select
    end do
  end subroutine event_functions

  !> Indices of the last knots that slip and speed of each block have passed, 0 if none.
  pure subroutine last_knots(of, nx, n, at, mode, memory, u_x, v_x, marks)
    type(resting_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(N_MEMORY, nx)
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(out) :: marks(N_MARK, nx)
    integer :: i, e

    do i = 1, nx
      e = at(i)
      marks(:, i) = 0.0_dp
      if (of%d_c(i) > 0.0_dp) marks(1, i) = cell(of%slide, slip_of(mode(i), memory(SLIP, i), u_x(e))/of%d_c(i))
      marks(2, i) = cell(of%speed, abs(v_x(e)))
    end do
  end subroutine last_knots

  !> Distances of slipping blocks to the next knot of slip [m], and to the next and the last knot of speed [m/s]. Steps end at
  !> knots, because a stepper keeps its order only if forces are smooth.
  pure subroutine knot_functions(of, nx, n, at, mode, memory, marks, u_x, v_x, g)
    type(resting_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(N_MEMORY, nx)
    real(dp), intent(in) :: marks(N_MARK, nx)    !! from `last_knots` at the start of the step
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(out) :: g(N_KNOT, nx)
    real(dp) :: v
    integer :: i, c

    g = 1.0_dp
    do i = 1, nx
      if (abs(mode(i)) /= 1) cycle
      c = int(marks(1, i))
      if (of%d_c(i) > 0.0_dp .and. c < of%slide%n) g(1, i) = of%slide%x(c + 1)*of%d_c(i) &
        - slip_of(mode(i), memory(SLIP, i), u_x(at(i)))
      v = real(mode(i), dp)*v_x(at(i))
      c = int(marks(2, i))
      if (c < of%speed%n) g(2, i) = of%speed%x(c + 1) - v
      if (c > 1) g(3, i) = v - of%speed%x(c)
    end do
  end subroutine knot_functions

  !> Time to the next knot of age of any slipping block, from time t on [s].
  pure function time_to_knot(of, nx, mode, memory, t) result(shortest)
    type(resting_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(N_MEMORY, nx)
    real(dp), intent(in) :: t                    !! time [s]
    real(dp) :: shortest
    integer :: i, c

    shortest = huge(shortest)
    if (of%age%n == 0) return
    do i = 1, nx
      c = cell(of%age, t - memory(SINCE, i))
      if (abs(mode(i)) == 1 .and. c < of%age%n) shortest = min(shortest, of%age%x(c + 1) - (t - memory(SINCE, i)))
    end do
  end function time_to_knot

  !> Stops blocks that no longer move in their direction of slip. Their kinetic energy is added to the switching loss.
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

  !> Contact states after a step, and the strength minus load of each block as if it were stuck.
  pure subroutine next_states(of, nx, n, at, mode, memory, t, other, p, v_x, new, margin)
    type(resting_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(N_MEMORY, nx)
    real(dp), intent(in) :: t                    !! time [s]
    real(dp), intent(in) :: other(LB:n + LANES)  !! all other horizontal forces, as a row [N]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    integer(ip), intent(out) :: new(nx)          !! new contact states
    real(dp), intent(out) :: margin(nx)          !! strength minus load [N]
    real(dp) :: strength
    integer :: i

    do i = 1, nx
      strength = static_strength(of, i, mode(i), memory(SINCE, i), t, p(i))
      margin(i) = strength - abs(other(at(i)))
      new(i) = next_state(strength, other(at(i)), p(i), mode(i), v_x(at(i)))
    end do
    where (of%bare) new = OPEN_GAP
  end subroutine next_states

  !> New contact state of a block by the paper's rule. A block at rest sticks up to its strength. Above this strength, the block
  !> slips in the direction of the other forces. A block that lands slips along its velocity.
  pure elemental function next_state(strength, other, p, mode, v_x) result(new)
    real(dp), intent(in) :: strength !! strength of the block if stuck [N]
    real(dp), intent(in) :: other    !! all other horizontal forces [N]
    real(dp), intent(in) :: p        !! foundation force [N]
    integer(ip), intent(in) :: mode  !! contact state
    real(dp), intent(in) :: v_x      !! velocity [m/s]
    integer(ip) :: new

    if (p <= 0.0_dp) then
      new = OPEN_GAP
    else if (v_x == 0.0_dp .and. abs(other) <= strength) then
      new = STUCK
    else if (v_x == 0.0_dp) then
      new = merge(1_ip, -1_ip, other > 0.0_dp)
    else if (mode == OPEN_GAP) then
      new = merge(1_ip, -1_ip, v_x > 0.0_dp)
    else
      new = mode
    end if
  end function next_state
end module pyfric_resting
