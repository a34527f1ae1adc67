!> The friction law, one of three kinds: laws under which blocks rest (pyfric_resting), junctions (pyfric_junctions), rate and
!> state (pyfric_rate_state). Only this module uses the modules of the three kinds.
!>
!> Each kind of law has its own fields, tables and state variables. Each kind gives the force, powers, energy, event functions,
!> contact states after a step, and changes of state variables at a switch. On junctions, and with rate and state, no block rests.
!> On junctions, the force follows from displacements and state variables; with rate and state, from speeds and a state variable.
module pyfric_law
  use pyfric_kinds, only: dp, ip, NOT_KNOWN
  use pyfric_layout, only: LB, LANES
  use pyfric_curve, only: curve_t, new_curve
  use pyfric_resting, only: resting_t, new_resting, STUCK, OPEN_GAP, N_CONTACT, N_KNOT, N_MARK, N_TABLES, stop_reversed, &
                            N_RESTING => N_FIELDS, resting_forces => forces, resting_powers => powers, &
                            resting_events => event_functions, resting_knots => last_knots, knots_ahead => knot_functions, &
                            time_to_age => time_to_knot, resting_states => next_states, resting_remember => remember
  use pyfric_junction_memory, only: n_whole, prepare
  use pyfric_junctions, only: junctions_t, new_junctions, forces, powers, stored_energy, settle, break_functions, next_release, &
                              drag_marks, drag_functions, N_JUNCTIONS => N_FIELDS
  use pyfric_evolution, only: rate_state_t, new_rate_state, log_rates, from_log_theta, add_stress, take_stress, &
                              N_RATE_STATE => N_FIELDS
  use pyfric_rate_state, only: rate_forces, rate_powers, begin_step, implicit_speeds, balanced_speeds
  implicit none (type, external)
  private
  public :: law_t, new_law, whole_memory, friction_force, friction_powers, interface_energy
  public :: event_functions, knot_functions, last_knots, time_to_knot
  public :: stop_reversed, next_states, settle_moving, remember
  public :: begin_step, implicit_speeds, balanced_speeds, log_rates, from_log_theta, add_stress, take_stress
  public :: STUCK, OPEN_GAP, N_TABLES, N_CONTACT, N_KNOT, N_MARK

  !> Codes of the kinds of laws, as `code` in pyfric.scene.
  integer(ip), parameter :: RESTING = 1, ON_JUNCTIONS = 2, RATE_STATE = 3
  !> Number of fields of N_x numbers of each kind of law.
  integer, parameter :: N_FIELDS(RATE_STATE) = [N_RESTING, N_JUNCTIONS, N_RATE_STATE]

  type :: law_t
    logical :: complete = .false.      !! whether memory was allocated, and the law is known
    logical :: known = .true.
    integer(ip), private :: kind
    integer :: n_memory                !! number of state variables of each block, including derived quantities
    integer :: per_block = 1           !! number of junctions of a block; 1 without junctions
    logical :: rests = .false.         !! whether blocks come to rest
    logical :: flows = .false.         !! whether each stage is implicit in the velocities of the blocks
    logical :: simple = .false.        !! whether friction heat has no parts
    logical :: kinked = .false.        !! whether friction over slip or speed has corners
    type(resting_t), private :: resting
    type(junctions_t), private :: junctions
    type(rate_state_t) :: rate_state
  end type law_t

contains

  !> The law from an array with fields of N_x numbers, other numbers of the law, and x and y of each knot of the law's tables.
  pure function new_law(nx, kind, n_memory, from_right, keeps, t_0, n_own, n_knots, numbers) result(law)
    integer, intent(in) :: nx                  !! blocks
    integer(ip), intent(in) :: kind
    integer(ip), intent(in) :: n_memory        !! number of saved state variables of each block
    logical, intent(in) :: from_right          !! whether blocks are counted from the right
    logical, intent(in) :: keeps               !! whether slip goes on after a stick
    real(dp), intent(in) :: t_0                !! time at which the limits hold [s]
    integer(ip), intent(in) :: n_own           !! how many other numbers the law has
    integer(ip), intent(in) :: n_knots(N_TABLES)
    real(dp), contiguous, intent(in) :: numbers(:)
    type(law_t) :: law
    type(curve_t) :: tables(N_TABLES)
    integer :: at(0:N_TABLES), own, k

    law%known = kind >= RESTING .and. kind <= RATE_STATE
    if (.not. law%known) return
    law%kind = kind
    law%n_memory = n_memory
    own = N_FIELDS(kind)*nx
    at(0) = own + n_own
    do k = 1, N_TABLES
      at(k) = at(k - 1) + 2*n_knots(k)
      tables(k) = new_curve(n_knots(k), numbers(at(k - 1) + 1:at(k)))
    end do
    select case (kind)
    case (RESTING)
      law%rests = .true.
      law%resting = new_resting(nx, numbers(:own), tables, keeps, t_0)
      law%complete = law%resting%complete
      law%simple = law%resting%simple
      law%kinked = law%resting%kinked
    case (ON_JUNCTIONS)
      law%junctions = new_junctions(nx, numbers(own + 1:at(0)), from_right, tables(1), tables(2), numbers(:own))
      law%complete = law%junctions%complete
      law%per_block = law%junctions%n
      law%n_memory = n_whole(law%junctions%n)
      law%kinked = .true.
    case (RATE_STATE)
      law%flows = .true.
      law%rate_state = new_rate_state(nx, numbers(own + 1:at(0)), numbers(:own))
      law%known = law%rate_state%known
      law%complete = law%rate_state%complete .and. law%known
    case default
      law%known = .false.
    end select
  end function new_law

  !> Saved state variables, with derived quantities.
  pure function whole_memory(law, nx, saved) result(memory)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx               !! blocks
    real(dp), intent(in) :: saved(:, :)     !! saved state variables of each block
    real(dp) :: memory(law%n_memory, nx)
    integer :: i

    memory(:size(saved, 1), :) = saved
    if (law%kind /= ON_JUNCTIONS) return
    do i = 1, nx
      call prepare(law%junctions%n, memory(1, i))
    end do
  end function whole_memory

  !> Friction forces on the blocks. Stuck: f balances all other horizontal forces. Slipping: mu p against the motion, and -alpha v.
  !> Open: 0.
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

    select case (law%kind)
    case (RESTING)
      call resting_forces(law%resting, nx, n, at, mode, memory, t, u_x, v_x, other, p, f)
    case (ON_JUNCTIONS)
      call forces(law%junctions, nx, n, at, memory, u_x, p, f)
    case (RATE_STATE)
      call rate_forces(law%rate_state, nx, memory, v_x(at(:nx)), p, f)
    case default
      f = NOT_KNOWN
    end select
  end subroutine friction_force

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
    real(dp), intent(in) :: p_rate(nx)           !! rate of p [N/s]
    real(dp), intent(in) :: f(nx)                !! friction force on the blocks, along +x [N]
    real(dp), intent(out) :: above(nx)           !! power above the kinetic strength; on junctions of dragging [W]
    real(dp), intent(out) :: viscous(nx)         !! power of alpha; on junctions of changes of stiffness [W]

    select case (law%kind)
    case (RESTING)
      call resting_powers(law%resting, nx, n, at, mode, v_x, p, f, above, viscous)
    case (ON_JUNCTIONS)
      call powers(law%junctions, nx, n, at, memory, u_x, v_x, p, p_rate, above, viscous)
    case (RATE_STATE)
      call rate_powers(law%rate_state, nx, v_x(at(:nx)), above, viscous)
    case default
      above = NOT_KNOWN
      viscous = NOT_KNOWN
    end select
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
    if (law%kind == ON_JUNCTIONS) energy = stored_energy(law%junctions, nx, memory, u_x, p)
  end function interface_energy

  !> Changes the state variables of a block at a switch.
  pure subroutine remember(law, old, new, t, u_x, memory)
    type(law_t), intent(in) :: law
    integer(ip), intent(in) :: old   !! old contact state
    integer(ip), intent(in) :: new   !! new contact state
    real(dp), intent(in) :: t        !! time [s]
    real(dp), intent(in) :: u_x      !! displacement [m]
    real(dp), intent(inout) :: memory(:)

    if (law%kind == RESTING) call resting_remember(law%resting, old, new, t, u_x, memory)
  end subroutine remember

  !> Event functions, which are positive while a contact state lasts, and strength minus load of each block as if it were stuck.
  !> Rate and state has no event functions.
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
    real(dp), intent(out) :: g(N_CONTACT, nx)    !! event functions of friction [N] or [m/s], of junctions and of the gap [m]
    real(dp), intent(out) :: margin(nx)          !! strength minus load [N]; 0 on junctions

    margin = 0.0_dp
    select case (law%kind)
    case (RESTING)
      call resting_events(law%resting, nx, n, at, mode, memory, t, other, p, z, v_x, g, margin)
    case (ON_JUNCTIONS)
      call break_functions(law%junctions, nx, n, at, mode /= OPEN_GAP, memory, p, u_x, z, g)
    case (RATE_STATE)
      g = 1.0_dp
    case default
      g = NOT_KNOWN
    end select
  end subroutine event_functions

  !> Indices of the last knots that slip and speed of each block have passed, 0 if none; on junctions `drag_marks`.
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
    real(dp), intent(in) :: p_rate(nx)           !! rate of p [N/s]
    real(dp), intent(out) :: marks(N_MARK, nx)

    select case (law%kind)
    case (RESTING)
      call resting_knots(law%resting, nx, n, at, mode, memory, u_x, v_x, marks)
    case (ON_JUNCTIONS)
      call drag_marks(law%junctions, nx, n, at, memory, u_x, v_x, p, p_rate, marks)
    case (RATE_STATE)
      marks = 0.0_dp
    case default
      marks = NOT_KNOWN
    end select
  end subroutine last_knots

  !> Distances of slipping blocks to the next knots, see pyfric_resting; on junctions `drag_functions`.
  pure subroutine knot_functions(law, nx, n, at, mode, memory, marks, u_x, v_x, p, p_rate, g)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: marks(N_MARK, nx)    !! from `last_knots` at the start of the step
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: p_rate(nx)           !! rate of p [N/s]
    real(dp), intent(out) :: g(N_KNOT, nx)

    select case (law%kind)
    case (RESTING)
      call knots_ahead(law%resting, nx, n, at, mode, memory, marks, u_x, v_x, g)
    case (ON_JUNCTIONS)
      call drag_functions(law%junctions, nx, n, at, u_x, v_x, p, p_rate, marks, g)
    case (RATE_STATE)
      g = 1.0_dp
    case default
      g = NOT_KNOWN
    end select
  end subroutine knot_functions

  !> Time from t to the next knot of age of any slipping block, or on junctions to the next pinning of a junction [s].
  pure function time_to_knot(law, nx, mode, memory, t) result(shortest)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(in) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: t                    !! time [s]
    real(dp) :: shortest

    select case (law%kind)
    case (RESTING)
      shortest = time_to_age(law%resting, nx, mode, memory, t)
    case (ON_JUNCTIONS)
      shortest = next_release(law%junctions, nx, mode /= OPEN_GAP, memory) - t
    case (RATE_STATE)
      shortest = huge(shortest)
    case default
      shortest = NOT_KNOWN
    end select
  end function time_to_knot

  !> Contact states after a step under a law with rest, and strength minus load of each block as if it were stuck.
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
    integer(ip), intent(out) :: new(nx)          !! new contact states
    real(dp), intent(out) :: margin(nx)          !! strength minus load [N]

    call resting_states(law%resting, nx, n, at, mode, memory, t, other, p, v_x, new, margin)
  end subroutine next_states

  !> Contact states after a step under a law without rest: ruptured or fast blocks slip. Junctions break and pin.
  pure subroutine settle_moving(law, nx, n, at, mode, memory, t, soon, u_x, v_x, p, new, margin, loss)
    type(law_t), intent(in) :: law
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    integer(ip), intent(in) :: mode(nx)          !! contact states
    real(dp), intent(inout) :: memory(law%n_memory, nx)
    real(dp), intent(in) :: t                    !! time [s]
    real(dp), intent(in) :: soon                 !! time ahead within which junctions pin now [s]
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    integer(ip), intent(out) :: new(nx)          !! new contact states
    real(dp), intent(out) :: margin(nx)          !! number of breaks before the block is ruptured, or v_slip - |v| [m/s]
    real(dp), intent(inout) :: loss(nx)          !! heat of breaks and of pinning so far [J]
    real(dp) :: along
    integer :: i

    along = 1.0_dp
    select case (law%kind)
    case (ON_JUNCTIONS)
      call settle(law%junctions, nx, n, at, t, soon, u_x, p, memory, margin, loss)
      if (law%junctions%from_right) along = -1.0_dp
    case (RATE_STATE)
      margin = law%rate_state%v_slip - abs(v_x(at(:nx)))
    case default
      margin = NOT_KNOWN
    end select
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
end module pyfric_law
