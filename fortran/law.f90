!> The friction law: the only module that uses its coefficients, its tables and the state variables of a block.
!>
!> It computes the strength of stuck and slipping blocks, the change of state variables by a switch, the event functions
!> that are positive while a contact state lasts, and the next contact state. A law is data: Python evaluates it at the
!> knots of tables, and it is linear between them. For block i, with slip s and age a (time since it stuck or slipped),
!>
!>     stuck      |f| <= (mu_s + hold(a)) p
!>     slipping   f = -(+-1) (mu_k + (mu_s - mu_k) slide(s/d_c)) speed(|v|) age(a) p - alpha v
!>
!> A limit, linear in time within a piece of the protocols, bounds all factors of p in both lines.
!>
!> A law without tables is Amontons-Coulomb: hold = slide = 0, speed = age = 1. Under the other laws no block comes to rest:
!> on junctions (pyfric_junctions) f follows from displacements and state variables, with rate-and-state friction
!> (pyfric_rate_state) from speeds and a state variable.
module pyfric_law
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: LB, LANES
  use pyfric_curve, only: curve_t, new_curve, cell, at_x
  use pyfric_junction_memory, only: n_whole, prepare
  use pyfric_junctions, only: junctions_t, new_junctions, forces, powers, stored_energy, settle, next_break, next_release, &
                              drag_limits, drag_functions
  use pyfric_evolution, only: rate_state_t, new_rate_state, log_rates, from_log_theta, add_stress, take_stress
  use pyfric_rate_state, only: rate_forces, begin_step, implicit_speeds, balanced_speeds
  implicit none (type, external)
  private
  public :: law_t, new_law, whole_memory, friction_force, friction_powers, interface_energy
  public :: event_functions, knot_functions, last_knots, time_to_knot
  public :: stop_reversed, next_states, settle_moving, remember
  public :: begin_step, implicit_speeds, balanced_speeds, log_rates, from_log_theta, add_stress, take_stress
  public :: STUCK, OPEN_GAP, N_TABLES, N_CONTACT, N_KNOT, N_MARK

  !> Contact states; slipping blocks have the sign of their motion, +1 or -1. On junctions a block counts as stuck while
  !> enough of them are pinned, with rate-and-state friction while it is slow. When it ruptures, the sign is that of its
  !> velocity.
  integer(ip), parameter :: STUCK = 0, OPEN_GAP = 2
  !> Laws: tables, on junctions, rate and state.
  integer(ip), parameter :: TABLES = 1, ON_JUNCTIONS = 2, RATE_STATE = 3
  !> Their tables, and fields of N_x numbers, in the order in which Python passes them.
  integer, parameter :: N_TABLES = 4, N_FIELDS(3) = [7, 5, 5]
  !> Event functions of a contact state; those of knots, and what is marked of knots at the start of a sub-step.
  integer, parameter :: N_CONTACT = 2, N_KNOT = 3, N_MARK = 4
  !> State variables of a block: s_0, see `slip_of` [m]; time at which it stuck or began to slip [s].
  integer, parameter :: SLIP = 1, SINCE = 2

  type :: law_t
    logical :: complete = .false.   !! there was enough memory, and the law is known
    logical :: known = .true.
    integer :: n_memory                !! state variables of each block
    logical :: rests                   !! blocks come to rest
    logical :: flows                   !! rate-and-state friction: each stage is implicit in the velocities of the blocks
    integer :: per_block = 1           !! junctions of a block; 1 without junctions
    logical :: simple                  !! no tables and no viscosity
    logical :: kinked = .false.        !! friction has corners over slip or speed
    type(junctions_t), private :: junctions
    type(rate_state_t) :: rate_state
    real(dp), allocatable :: mu_s(:)   !! static friction coefficient [-]
    real(dp), allocatable :: mu_k(:)   !! kinetic friction coefficient [-]
    real(dp), allocatable :: d_c(:)    !! unit of slip of the table, 0 for at once [m]
    real(dp), allocatable :: alpha(:)  !! viscosity of slip [N s/m]
    logical, allocatable :: bare(:)    !! no friction, also in contact: such a block counts as open
    logical :: keeps = .false.         !! a stick does not end a slip
    logical :: limited = .false.       !! some blocks have a limit
    real(dp) :: t_0                    !! time of the limits [s]
    real(dp), allocatable :: limit(:)  !! largest friction coefficient then [-]
    real(dp), allocatable :: limit_rate(:) !! its rate [1/s]
    type(curve_t), private :: hold     !! gain of mu_s, over time since the block stuck [s]
    type(curve_t), private :: slide    !! share of mu_s - mu_k that is left, over slip/d_c
    type(curve_t), private :: speed    !! factor, over abs(v) [m/s]
    type(curve_t), private :: age      !! factor, over time since slip began [s]
  end type law_t

contains

  !> The law from its fields of N_x numbers, numbers of its own, and tables, one after another: x and y of each knot. Tables: mu_s,
  !> mu_k, d_c, alpha, bare, the limit and its rate. On junctions: quantiles of t_R in the first table, u_s of each junction over
  !> that of the block in the second; other laws: see there.
  pure function new_law(nx, kind, n_memory, from_right, t_0, n_own, n_knots, numbers) result(law)
    integer, intent(in) :: nx                  !! blocks
    integer(ip), intent(in) :: kind
    integer(ip), intent(in) :: n_memory        !! numbers that are saved of each block
    logical, intent(in) :: from_right          !! blocks are counted from the right
    real(dp), intent(in) :: t_0                !! time of the limits [s]
    integer(ip), intent(in) :: n_own           !! numbers of its own
    integer(ip), intent(in) :: n_knots(N_TABLES)
    real(dp), contiguous, intent(in) :: numbers(:)
    type(law_t) :: law
    integer :: at(0:N_TABLES), own, k, failed

    law%known = kind >= TABLES .and. kind <= RATE_STATE
    if (.not. law%known) return
    own = N_FIELDS(kind)*nx
    at(0) = own + n_own
    do k = 1, N_TABLES
      at(k) = at(k - 1) + 2*n_knots(k)
    end do
    law%hold = new_curve(n_knots(1), numbers(at(0) + 1:at(1)))
    law%slide = new_curve(n_knots(2), numbers(at(1) + 1:at(2)))
    law%speed = new_curve(n_knots(3), numbers(at(2) + 1:at(3)))
    law%age = new_curve(n_knots(4), numbers(at(3) + 1:at(4)))
    allocate (law%mu_s(nx), law%mu_k(nx), law%d_c(nx), law%alpha(nx), law%bare(nx), law%limit(nx), law%limit_rate(nx), stat=failed)
    law%complete = failed == 0 .and. law%hold%complete .and. law%slide%complete .and. law%speed%complete .and. law%age%complete
    if (.not. law%complete) return
    law%n_memory = n_memory
    law%rests = kind == TABLES
    law%flows = kind == RATE_STATE
    law%simple = .false.
    select case (kind)
    case (TABLES)
      call take_fields(nx, numbers(:own), law)
      law%t_0 = t_0
      law%kinked = law%slide%n > 0 .or. law%speed%n > 0
      law%simple = all(n_knots == 0) .and. all(law%alpha <= 0.0_dp) .and. .not. law%limited
    case (ON_JUNCTIONS)
      law%junctions = new_junctions(nx, numbers(own + 1:at(0)), from_right, law%hold, law%slide, numbers(:own))
      law%complete = law%junctions%complete
      law%per_block = law%junctions%n
      law%n_memory = n_whole(law%junctions%n)
      law%kinked = .true.
    case (RATE_STATE)
      law%rate_state = new_rate_state(nx, numbers(own + 1:at(0)), numbers(:own))
      law%known = law%rate_state%known
      law%complete = law%rate_state%complete .and. law%known
    case default
      law%known = .false.
    end select
  end function new_law

  pure subroutine take_fields(nx, fields, law)
    integer, intent(in) :: nx                  !! blocks
    real(dp), intent(in) :: fields(nx, N_FIELDS(TABLES))
    type(law_t), intent(inout) :: law

    law%mu_s(:) = fields(:, 1)
    law%mu_k(:) = fields(:, 2)
    law%d_c(:) = fields(:, 3)
    law%alpha(:) = fields(:, 4)
    law%bare(:) = fields(:, 5) > 0.0_dp
    law%limit(:) = fields(:, 6)
    law%limit_rate(:) = fields(:, 7)
    law%limited = any(law%limit < huge(1.0_dp))
  end subroutine take_fields

  !> State variables that are saved, and quantities that follow from them.
  pure function whole_memory(law, nx, saved) result(memory)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx               !! blocks
    real(dp), intent(in) :: saved(:, :)     !! numbers of each block
    real(dp) :: memory(law%n_memory, nx)
    integer :: i

    memory(:size(saved, 1), :) = saved
    if (law%rests .or. law%flows) return
    do i = 1, nx
      call prepare(law%junctions%n, memory(1, i))
    end do
  end function whole_memory

  !> Stuck: f balances all other horizontal forces. Slipping: mu p against the motion, and -alpha v. Open: none.
  pure subroutine friction_force(law, nx, n, at, mode, memory, t, u_x, v_x, other, p, f)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: t                    !! time [s]
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: other(LB:n + LANES)  !! all other horizontal forces, as a row [N]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(out) :: f(nx)               !! friction force on the blocks, along +x [N]
    real(dp) :: mu, theta(nx)
    integer :: i

    if (law%flows) then
      theta = memory(1, :)
      call rate_forces(law%rate_state, nx, theta, v_x(at(:nx)), p, f)
      return
    else if (.not. law%rests) then
      call forces(law%junctions, nx, n, at, memory, u_x, p, f)
      return
    end if
    do i = 1, nx
      select case (mode(i))
      case (STUCK)
        f(i) = -other(at(i))
      case (OPEN_GAP)
        f(i) = 0.0_dp
      case default
        f(i) = -real(mode(i), dp)*(law%mu_k(i)*p(i))
      end select
    end do
    if (law%simple) return
    do i = 1, nx
      if (abs(mode(i)) /= 1) cycle
      mu = sliding(law, i, slip_of(mode(i), memory(SLIP, i), u_x(at(i))), v_x(at(i)), t - memory(SINCE, i))
      if (law%limited) mu = min(mu, limit_at(law, i, t))
      f(i) = -real(mode(i), dp)*(mu*p(i)) - law%alpha(i)*v_x(at(i))
    end do
  end subroutine friction_force

  !> mu of a block that slips, from its slip [m], velocity [m/s] and the time since it began [s].
  pure function sliding(law, i, path, v, age) result(mu)
    type(law_t), intent(in) :: law
    integer, intent(in) :: i
    real(dp), intent(in) :: path
    real(dp), intent(in) :: v
    real(dp), intent(in) :: age
    real(dp) :: mu, remaining

    mu = law%mu_k(i)
    if (law%slide%n > 0) then
      remaining = law%slide%y(law%slide%n)
      if (law%d_c(i) > 0.0_dp) remaining = at_x(law%slide, path/law%d_c(i))
      mu = mu + (law%mu_s(i) - mu)*remaining
    end if
    if (law%speed%n > 0) mu = mu*at_x(law%speed, abs(v))
    if (law%age%n > 0) mu = mu*at_x(law%age, age)
  end function sliding

  !> Largest friction coefficient of a block at time t [s].
  pure function limit_at(law, i, t) result(mu)
    type(law_t), intent(in) :: law
    integer, intent(in) :: i
    real(dp), intent(in) :: t
    real(dp) :: mu

    mu = max(law%limit(i) + law%limit_rate(i)*(t - law%t_0), 0.0_dp)
  end function limit_at

  !> Friction power above mu_k p, and power of alpha. On junctions: the heat of dragging, and the work of changes of
  !> stiffness.
  pure subroutine friction_powers(law, nx, n, at, mode, memory, u_x, v_x, p, p_rate, f, above, viscous)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: p_rate(nx)           !! its rate [N/s]
    real(dp), intent(in) :: f(nx)                !! friction force on the blocks, along +x [N]
    real(dp), intent(out) :: above(nx)           !! [W]
    real(dp), intent(out) :: viscous(nx)         !! [W]
    real(dp) :: v
    integer :: i

    if (.not. (law%rests .or. law%flows)) then
      call powers(law%junctions, nx, n, at, memory, u_x, v_x, p, p_rate, above, viscous)
      return
    end if
    above = 0.0_dp
    viscous = 0.0_dp
    do i = 1, nx
      if (abs(mode(i)) /= 1 .and. .not. law%flows) cycle
      v = v_x(at(i))
      if (law%flows) then
        viscous(i) = law%rate_state%alpha(i)*v*v
        cycle
      end if
      viscous(i) = law%alpha(i)*v*v
      above(i) = -(f(i) + law%alpha(i)*v + real(mode(i), dp)*(law%mu_k(i)*p(i)))*v
    end do
  end subroutine friction_powers

  !> Elastic energy of junctions [J].
  pure function interface_energy(law, nx, memory, u_x, p) result(energy)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx            !! blocks
    real(dp), intent(in) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: u_x(nx)      !! displacements, left to right [m]
    real(dp), intent(in) :: p(nx)        !! foundation force [N]
    real(dp) :: energy

    energy = 0.0_dp
    if (.not. (law%rests .or. law%flows)) energy = stored_energy(law%junctions, nx, memory, u_x, p)
  end function interface_energy

  !> Strength of a stuck block [N]; a block that has just stopped has age 0.
  pure function static_strength(law, i, mode, t_stuck, t, p) result(strength)
    type(law_t), intent(in) :: law
    integer, intent(in) :: i
    integer(ip), intent(in) :: mode  !! contact state
    real(dp), intent(in) :: t_stuck  !! when it stuck [s]
    real(dp), intent(in) :: t        !! time [s]
    real(dp), intent(in) :: p        !! foundation force [N]
    real(dp) :: strength

    if (law%hold%n == 0) then
      strength = law%mu_s(i)*p
    else
      strength = (law%mu_s(i) + at_x(law%hold, merge(t - t_stuck, 0.0_dp, mode == STUCK)))*p
    end if
    if (law%limited) strength = min(strength, limit_at(law, i, t)*p)
  end function static_strength

  !> Slip since the last stick, s = s_0 +- u_x; within a step it follows the displacement of each stage.
  pure elemental function slip_of(mode, s_0, u_x) result(path)
    integer(ip), intent(in) :: mode  !! contact state
    real(dp), intent(in) :: s_0      !! set when the contact state changes; the slip itself while the block is open [m]
    real(dp), intent(in) :: u_x      !! displacement [m]
    real(dp) :: path

    path = s_0
    if (abs(mode) == 1) path = s_0 + real(mode, dp)*u_x
  end function slip_of

  !> Changes the state variables of a block at a switch. After a stick, slip and time start at 0; otherwise they go on. Slip
  !> always goes on if the law keeps it.
  pure subroutine remember(law, old, new, t, u_x, memory)
    type(law_t), intent(in) :: law
    integer(ip), intent(in) :: old   !! contact state before
    integer(ip), intent(in) :: new   !! contact state after
    real(dp), intent(in) :: t        !! time [s]
    real(dp), intent(in) :: u_x      !! displacement [m]
    real(dp), intent(inout) :: memory(:)

    memory(SLIP) = slip_of(old, memory(SLIP), u_x)
    if (new == STUCK .and. .not. law%keeps) memory(SLIP) = 0.0_dp
    memory(SLIP) = slip_of(new, memory(SLIP), -u_x)
    if (old == STUCK .or. new == STUCK) memory(SINCE) = t
  end subroutine remember

  !> Event functions, positive while a contact state lasts. Stuck: strength minus |f|; slipping: velocity along the slip; on
  !> junctions: distance to the next break; all of these: the depth. Open: the height, twice. Bare: none.
  pure subroutine event_functions(law, nx, n, at, mode, memory, t, other, p, u_x, z, v_x, g, margin)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: t                    !! time [s]
    real(dp), intent(in) :: other(LB:n + LANES)  !! all other horizontal forces, as a row [N]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: z(nx)                !! heights above the foundation [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(out) :: g(N_CONTACT, nx)    !! of friction [N] or [m/s], of junctions and of the gap [m]
    real(dp), intent(out) :: margin(nx)          !! of friction if the block were stuck [N]
    integer :: i

    if (.not. law%rests) then
      margin = 0.0_dp
      do i = 1, nx
        g(:, i) = z(i)
        if (mode(i) /= OPEN_GAP) g(:, i) = [next_break(law%junctions, i, u_x(at(i)), p(i), memory(1, i)), -z(i)]
      end do
      return
    end if
    do i = 1, nx
      margin(i) = static_strength(law, i, mode(i), memory(SINCE, i), t, p(i)) - abs(other(at(i)))
      g(2, i) = -z(i)
      select case (mode(i))
      case (STUCK)
        g(1, i) = margin(i)
      case (OPEN_GAP)
        g(:, i) = merge(1.0_dp, z(i), law%bare(i))
      case default
        g(1, i) = real(mode(i), dp)*v_x(at(i))
      end select
    end do
  end subroutine event_functions

  !> Last knots passed by slip and speed of each block, 0 for none; on junctions the marks of dragged ones.
  pure subroutine last_knots(law, nx, n, at, mode, memory, u_x, v_x, p, p_rate, marks)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: p_rate(nx)           !! its rate [N/s]
    real(dp), intent(out) :: marks(N_MARK, nx)
    integer :: i, e

    do i = 1, nx
      e = at(i)
      if (.not. law%rests) then
        marks(:, i) = drag_limits(law%junctions, i, u_x(e), v_x(e), p(i), p_rate(i), memory(1, i))
        cycle
      end if
      marks(:, i) = 0.0_dp
      if (law%d_c(i) > 0.0_dp) marks(1, i) = cell(law%slide, slip_of(mode(i), memory(SLIP, i), u_x(e))/law%d_c(i))
      marks(2, i) = cell(law%speed, abs(v_x(e)))
    end do
  end subroutine last_knots

  !> Distances of slipping blocks to the next knot of slip [m], and to the next and last ones of speed [m/s]; on junctions
  !> `drag_functions`. Steps end there, because a stepper keeps its order only where forces are smooth.
  pure subroutine knot_functions(law, nx, n, at, mode, memory, marks, u_x, v_x, p, p_rate, g)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: marks(N_MARK, nx)    !! of `last_knots` at the start of the step
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: p_rate(nx)           !! its rate [N/s]
    real(dp), intent(out) :: g(N_KNOT, nx)
    real(dp) :: v
    integer :: i, c

    g = 1.0_dp
    do i = 1, nx
      if (.not. law%rests) g(:, i) = drag_functions(law%junctions, i, u_x(at(i)), v_x(at(i)), p(i), p_rate(i), marks(:, i))
      if (abs(mode(i)) /= 1 .or. .not. law%rests) cycle
      c = int(marks(1, i))
      if (law%d_c(i) > 0.0_dp .and. c < law%slide%n) g(1, i) = law%slide%x(c + 1)*law%d_c(i) &
        - slip_of(mode(i), memory(SLIP, i), u_x(at(i)))
      v = real(mode(i), dp)*v_x(at(i))
      c = int(marks(2, i))
      if (c < law%speed%n) g(2, i) = law%speed%x(c + 1) - v
      if (c > 1) g(3, i) = v - law%speed%x(c)
    end do
  end subroutine knot_functions

  !> Time to the next knot of age of any slipping block, from time t on; or to the next junction that pins [s].
  pure function time_to_knot(law, nx, mode, memory, t) result(shortest)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: t                    !! [s]
    real(dp) :: shortest
    integer :: i, c

    shortest = huge(shortest)
    if (.not. law%rests) shortest = next_release(law%junctions, nx, mode /= OPEN_GAP, memory) - t
    if (law%age%n == 0) return
    do i = 1, nx
      c = cell(law%age, t - memory(SINCE, i))
      if (abs(mode(i)) == 1 .and. c < law%age%n) shortest = min(shortest, law%age%x(c + 1) - (t - memory(SINCE, i)))
    end do
  end function time_to_knot

  !> Stops blocks that no longer move in their direction of slip; their kinetic energy is the switching loss.
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
  pure subroutine next_states(law, nx, n, at, mode, memory, t, other, p, v_x, new, margin)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: t                    !! time [s]
    real(dp), intent(in) :: other(LB:n + LANES)  !! all other horizontal forces, as a row [N]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    integer(ip), intent(out) :: new(nx)          !! contact states after
    real(dp), intent(out) :: margin(nx)          !! [N]
    real(dp) :: strength
    integer :: i

    do i = 1, nx
      strength = static_strength(law, i, mode(i), memory(SINCE, i), t, p(i))
      margin(i) = strength - abs(other(at(i)))
      new(i) = next_state(strength, other(at(i)), p(i), mode(i), v_x(at(i)))
    end do
    where (law%bare) new = OPEN_GAP
  end subroutine next_states

  !> The contact states after a step of blocks that never rest: ruptured or fast ones slip. Junctions break and pin.
  pure subroutine settle_moving(law, nx, n, at, mode, memory, t, soon, u_x, v_x, p, new, margin, loss)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(inout) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: t                    !! time [s]
    real(dp), intent(in) :: soon                 !! junctions pin whose time comes so soon [s]
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    integer(ip), intent(out) :: new(nx)          !! contact states after
    real(dp), intent(out) :: margin(nx)          !! pinned junctions that may break, or speed missing [m/s], before the block slips
    real(dp), intent(inout) :: loss(nx)          !! heat of breaks and of pinning so far [J]
    real(dp) :: along
    integer :: i

    if (law%flows) then
      margin = law%rate_state%v_slip - abs(v_x(at(:nx)))
    else
      call settle(law%junctions, nx, n, at, t, soon, u_x, p, memory, margin, loss)
    end if
    along = merge(-1.0_dp, 1.0_dp, law%junctions%from_right)
    do i = 1, nx
      if (p(i) <= 0.0_dp) then
        new(i) = OPEN_GAP
      else if (margin(i) >= 0.0_dp) then
        new(i) = STUCK
      else
        new(i) = mode(i)
        if (abs(mode(i)) /= 1 .or. law%flows) new(i) = int(merge(along, -along, along*v_x(at(i)) >= 0.0_dp), ip)
      end if
    end do
  end subroutine settle_moving

  !> The paper's rule for one block. A block at rest sticks up to its strength. Above it, the block slips
  !> in the direction of the other forces. A block that lands slips along its velocity.
  pure elemental function next_state(strength, other, p, mode, v_x) result(new)
    real(dp), intent(in) :: strength !! what it bears if stuck [N]
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
end module pyfric_law
