!> Slip without inertia under rate-and-state friction.
!>
!> There are 2 N_x equations for the displacements u since the beginning and y = ln(theta). If the law has a rate of stress, y
!> includes a share of stress (pyfric_evolution).
!>
!>     du/dt = v(load, p, y) ,   dy/dt = X(v, y) ,   load = load_0 + load_1 t + load_2 t^2/2 + load_u u + load_v v .
!>
!> The normal force p has the same form as the load. v follows from `balanced_speeds`. The term load_v v, due to viscosity of bonds,
!> couples the speeds of blocks. Iterations, called turns, solve for the coupled speeds. In steady slip the equations are stiff: a
!> block relaxes over a slip of p a/(dload/du). Each step therefore solves linear equations with the Jacobian. The method is a
!> Rosenbrock method of order 5, with an embedded method of order 4 and polynomials of order 4 inside the step. y is eliminated,
!> which leaves a matrix of N_x x N_x numbers.
!>
!> Source: G. Steinebach, BIT Numer. Math. 63, 27 (2023), for the method, Rodas5P; E. Hairer, G. Wanner, Solving Ordinary
!> Differential Equations II, section IV.7, for its form without products by the Jacobian.
module pyfric_slow_slip
  use pyfric_kinds, only: dp, ip
  use pyfric_elementary, only: exponentials, logarithms
  use pyfric_law, only: law_t, balanced_speeds, log_rates, from_log_theta, add_stress, take_stress
  use pyfric_dense, only: decompose, solve, applied
  implicit none (type, external)
  private
  public :: condensed_t, limits_t, phase_t, passages_t, work_t, new_condensed, new_work, begin_phase, advance_phase, velocities, &
            end_phase
  public :: GOES_ON, FINISHED, FAST, ABRUPT, SHORT

  !> Codes of the reason why steps ended: the largest number of steps was made; the phase ended; a limit was reached; the error of a
  !> shortest step is too large; steps are too short.
  integer(ip), parameter :: GOES_ON = 0, FINISHED = 1, FAST = 2, ABRUPT = 3, SHORT = 4

  integer, parameter :: STAGES = 8, U = 1, Y = 2
  real(dp), parameter :: GAMMA = 0.21193756319429014_dp
  !> Time of each stage, and coefficient of the derivative by time in each stage.
  real(dp), parameter :: AT(STAGES) = [ &
                         0.0_dp, 0.6358126895828704_dp, 0.4095798393397535_dp, 0.9769306725060716_dp, 0.4288403609558664_dp, &
                         1.0_dp, 1.0_dp, 1.0_dp]
  real(dp), parameter :: BY_TIME(STAGES) = [ &
                         GAMMA, -0.42387512638858027_dp, -0.3384627126235924_dp, 1.8046452872882734_dp, &
                         2.325825639765069_dp, 0.0_dp, 0.0_dp, 0.0_dp]
  !> Weights of increments of earlier stages in stage i, column i: in the state (A), and in the right side (C). The last two stages
  !> and the end of the step add one increment each.
  real(dp), parameter :: A(5, 2:6) = reshape([ &
                         3.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, &
                         2.849394379747939_dp, 0.45842242204463923_dp, 0.0_dp, 0.0_dp, 0.0_dp, &
                         -6.954028509809101_dp, 2.489845061869568_dp, -10.358996098473584_dp, 0.0_dp, 0.0_dp, &
                         2.8029986275628964_dp, 0.5072464736228206_dp, -0.3988312541770524_dp, -0.04721187230404641_dp, 0.0_dp, &
                         -7.502846399306121_dp, 2.561846144803919_dp, -11.627539656261098_dp, -0.18268767659942256_dp, &
                         0.030198172008377946_dp], [5, 5])
  real(dp), parameter :: C(7, STAGES) = reshape([ &
                         0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, &
                         -14.155112264123755_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, &
                         -17.97296035885952_dp, -2.859693295451294_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, &
                         147.12150275711716_dp, -1.41221402718213_dp, 71.68940251302358_dp, 0.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, &
                         165.43517024871676_dp, -0.4592823456491126_dp, 42.90938336958603_dp, -5.961986721573306_dp, &
                         0.0_dp, 0.0_dp, 0.0_dp, &
                         24.854864614690072_dp, -3.0009227002832186_dp, 47.4931110020768_dp, 5.5814197821558125_dp, &
                         -0.6610691825249471_dp, 0.0_dp, 0.0_dp, &
                         30.91273214028599_dp, -3.1208243349937974_dp, 77.79954646070892_dp, 34.28646028294783_dp, &
                         -19.097331116725623_dp, -28.087943162872662_dp, 0.0_dp, &
                         37.80277123390563_dp, -3.2571969029072276_dp, 112.26918849496327_dp, 66.9347231244047_dp, &
                         -40.06618937091002_dp, -54.66780262877968_dp, -9.48861652309627_dp], [7, STAGES])
  !> Coefficients of the polynomials inside the step.
  real(dp), parameter :: INSIDE(STAGES, 3) = reshape([ &
                         25.948786856663858_dp, -2.5579724845846235_dp, 10.433815404888879_dp, -2.3679251022685204_dp, &
                         0.524948541321073_dp, 1.1241088310450404_dp, 0.4272876194431874_dp, -0.17202221070155493_dp, &
                         -9.91568850695171_dp, -0.9689944594115154_dp, 3.0438037242978453_dp, -24.495224566215796_dp, &
                         20.176138334709044_dp, 15.98066361424651_dp, -6.789040303419874_dp, -6.710236069923372_dp, &
                         11.419903575922262_dp, 2.8879645146136994_dp, 72.92137995996029_dp, 80.12511834622643_dp, &
                         -52.072871366152654_dp, -59.78993625266729_dp, -0.15582684282751913_dp, 4.883087185713722_dp], [STAGES, 3])

  !> Step control: safety factor, smallest and largest ratio of a step to the step before. Number of halvings that locate a limit.
  !> Largest number of iterations for a passage. Largest number of turns. TURNED: share of the largest change of v below which turns
  !> end. SLOWLY: ratio of the changes of v in two successive turns above which Newton's method makes the next turns.
  real(dp), parameter :: SAFE = 0.9_dp, SHORTER = 0.2_dp, LONGER = 6.0_dp
  integer, parameter :: HALVINGS = 40, MOST = 100, TURNS = 200
  real(dp), parameter :: TURNED = 1e-12_dp, SLOWLY = 0.05_dp

  type :: condensed_t
    logical :: complete = .false.         !! whether memory was allocated
    integer :: nx
    type(law_t) :: law
    logical, allocatable :: closed(:)     !! whether each block is in contact
    real(dp), allocatable :: unit(:)      !! ln(D_c/V*), subtracted from y for its relative error
    real(dp), allocatable :: load(:, :)   !! on each block along +x: value, first, second time derivative [N, N/s, N/s2]
    real(dp), allocatable :: load_u(:, :) !! derivatives of load by displacements [N/m]
    real(dp), allocatable :: load_v(:, :) !! by velocities of other blocks [N s/m]; alpha includes the block's own
    real(dp), allocatable :: load_a(:, :) !! derivatives of load by accelerations [kg]
    real(dp), allocatable :: p(:, :)      !! normal force; this array and the next three have the form of load to load_a
    real(dp), allocatable :: p_u(:, :)
    real(dp), allocatable :: p_v(:, :)
    real(dp), allocatable :: p_a(:, :)
    logical :: viscous                    !! whether load_v or p_v is not zero
    logical :: inertial                   !! whether load_a or p_a is not zero
  end type condensed_t

  type :: limits_t
    real(dp) :: end             !! end of the phase, to which the last step is shortened [s]
    real(dp) :: dt              !! spacing of the time grid, and the shortest step that is tried again [s]
    real(dp) :: relative        !! relative error of a step in u and y
    real(dp) :: absolute(2)     !! additional absolute errors of u [m] and of y
    real(dp) :: inertia         !! largest sum of loads by inertia [N]
    real(dp) :: speed           !! largest speed [m/s]
    real(dp) :: least           !! length of steps below which the phase ends if steps do not grow [s]
    real(dp) :: last            !! requested time of the final state; the first step that reaches this time is the last [s]
    integer :: steps            !! largest number of steps
  end type limits_t

  type :: phase_t
    real(dp) :: t = 0.0_dp               !! time since the beginning [s]
    real(dp) :: h = 0.0_dp               !! length of the next step [s]
    real(dp) :: t_grid = 0.0_dp          !! last time on the grid of time steps [s]
    integer :: steps = 0                 !! number of steps made
    integer :: n_points = 0              !! number of points reached
    real(dp), allocatable :: q(:, :)     !! u [m] and ln(theta)
    real(dp), allocatable :: grid(:, :)  !! u [m] and ln(theta) at t_grid
  end type phase_t

  !> Passages of blocks through a threshold of speed.
  type :: passages_t
    real(dp) :: threshold                !! speed above which a block is fast [m/s]
    integer :: n = 0                     !! number of passages
    integer(ip), allocatable :: fast(:)  !! 1 or -1 for blocks that are fast to the right or left, 0 for others
    integer(ip), allocatable :: of(:, :) !! block of each passage, from 0, and its new value in `fast`
    real(dp), allocatable :: at(:, :)    !! time since the beginning [s], p of the block [N], and u of all blocks [m]
    real(dp), allocatable :: sums(:, :)  !! at the ends of steps: time [s], |sum of v| [m/s]
  end type passages_t

  type :: slopes_t
    real(dp), allocatable :: by_load(:)  !! derivatives of v, see `balanced_speeds`
    real(dp), allocatable :: by_p(:)
    real(dp), allocatable :: by_y(:)
    real(dp), allocatable :: x_v(:)      !! derivatives of X, see `log_rates`
    real(dp), allocatable :: x_y(:)
    real(dp), allocatable :: by_t(:)     !! derivative of v by time
    logical :: factored                  !! whether the next two are factors of the equations of `turn`, at nearby slopes
    real(dp), allocatable :: lu(:, :)
    integer, allocatable :: pivot(:)
  end type slopes_t

  type :: work_t
    logical :: complete = .false.          !! whether memory was allocated
    type(slopes_t) :: slopes               !! derivatives at the beginning of a step
    type(slopes_t) :: others               !! derivatives at other times
    real(dp), allocatable :: lu(:, :)      !! see `prepare`
    integer, allocatable :: pivot(:)
    real(dp), allocatable :: k(:, :, :)    !! increments of stages
    real(dp), allocatable :: poly(:, :, :) !! see `inside_step`
    real(dp), allocatable :: q_new(:, :)   !! state at the end of a step
  end type work_t

contains

  !> Rates of u and y, and derivatives of the rates at fixed load and p. If turns do not converge, v is huge.
  !>
  !> Inertia acts to first order: loads by inertia follow from accelerations without inertia.
  pure subroutine rates_at(s, t, q, f, slopes, p, inertia)
    type(condensed_t), intent(in) :: s
    real(dp), intent(in) :: t                 !! time [s]
    real(dp), intent(in) :: q(s%nx, 2)        !! u [m], y
    real(dp), intent(out) :: f(s%nx, 2)       !! [m/s], [1/s]
    type(slopes_t), intent(inout) :: slopes
    real(dp), intent(out) :: p(s%nx)          !! normal forces [N]
    real(dp), intent(out), optional :: inertia !! sum of loads by inertia [N]
    real(dp), dimension(s%nx) :: load, load_0, p_0, a
    integer :: i

    load_0 = s%load(:, 1) + t*(s%load(:, 2) + 0.5_dp*t*s%load(:, 3)) + applied(s%nx, s%load_u, q(:, U))
    p_0 = s%p(:, 1) + t*(s%p(:, 2) + 0.5_dp*t*s%p(:, 3)) + applied(s%nx, s%p_u, q(:, U))
    slopes%factored = .false.
    call rates_under(s, t, q, load_0, p_0, f, slopes, p)
    if (present(inertia)) inertia = 0.0_dp
    if (.not. s%inertial) return
    call accelerate(s, f, slopes, a)
    load = applied(s%nx, s%load_a, a)
    p_0 = p_0 + applied(s%nx, s%p_a, a)
    call rates_under(s, t, q, load_0 + load, p_0, f, slopes, p)
    if (.not. present(inertia)) return
    do i = 1, s%nx
      inertia = inertia + abs(load(i))
    end do
  end subroutine rates_at

  !> Rates of u and y, and derivatives of the rates, from load and normal force without viscosity.
  pure subroutine rates_under(s, t, q, load_0, p_0, f, slopes, p)
    type(condensed_t), intent(in) :: s
    real(dp), intent(in) :: t                 !! time [s]
    real(dp), intent(in) :: q(s%nx, 2)        !! u [m], y
    real(dp), intent(in) :: load_0(s%nx)      !! load without viscosity [N]
    real(dp), intent(in) :: p_0(s%nx)         !! normal force without viscosity [N]
    real(dp), intent(out) :: f(s%nx, 2)       !! [m/s], [1/s]
    type(slopes_t), intent(inout) :: slopes
    real(dp), intent(out) :: p(s%nx)          !! normal forces [N]
    real(dp), dimension(s%nx) :: load, v, change, pressed
    real(dp) :: before
    integer :: n

    load = load_0
    p = p_0
    v = 0.0_dp
    before = huge(before)
    do n = 1, TURNS
      pressed = merge(p, 0.0_dp, s%closed)
      call balanced_speeds(s%law%rate_state, s%nx, load, pressed, q(:, Y), f(:, U), slopes%by_load, slopes%by_p, slopes%by_y)
      change = f(:, U) - v
      if (.not. s%viscous .or. maxval(abs(change)) <= TURNED*maxval(abs(f(:, U)))) exit
      call turn(s, slopes, before, change)
      v = v + change
      load = load_0 + applied(s%nx, s%load_v, v)
      p = p_0 + applied(s%nx, s%p_v, v)
    end do
    if (n > TURNS) f(:, U) = huge(v)
    call log_rates(s%law%rate_state, 1, s%nx, f(:, U), q(:, Y), f(:, Y), slopes%x_v, slopes%x_y)
    slopes%by_t = slopes%by_load*(s%load(:, 2) + t*s%load(:, 3)) + slopes%by_p*(s%p(:, 2) + t*s%p(:, 3))
    call damp(s, slopes, slopes%by_t)
  end subroutine rates_under

  !> Change of v by viscosity, (by_load load_v + by_p p_v) x, due to a change x of v.
  pure function resisted(s, slopes, x) result(y)
    type(condensed_t), intent(in) :: s
    type(slopes_t), intent(in) :: slopes
    real(dp), intent(in) :: x(s%nx)      !! [m/s] or its rates
    real(dp) :: y(s%nx)

    y = 0.0_dp
    if (s%viscous) y = slopes%by_load*applied(s%nx, s%load_v, x) + slopes%by_p*applied(s%nx, s%p_v, x)
  end function resisted

  !> Changes x of v with viscosity, by turns: x = free + `resisted` x, where `free` are changes without viscosity.
  pure subroutine damp(s, slopes, x)
    type(condensed_t), intent(in) :: s
    type(slopes_t), intent(inout) :: slopes
    real(dp), intent(inout) :: x(s%nx)    !! on entry changes without viscosity, on return with viscosity
    real(dp) :: free(s%nx), change(s%nx), before
    integer :: n

    free = x
    before = huge(before)
    do n = 1, merge(TURNS, 0, s%viscous)
      change = free + resisted(s, slopes, x) - x
      if (maxval(abs(change)) <= TURNED*maxval(abs(x))) exit
      call turn(s, slopes, before, change)
      x = x + change
    end do
  end subroutine damp

  !> The change of v, or of its rate, in the next turn, from the remaining change. If turns converge slowly, linear equations give
  !> the change. Their factors are stored until turns are slow again.
  pure subroutine turn(s, slopes, before, change)
    type(condensed_t), intent(in) :: s
    type(slopes_t), intent(inout) :: slopes
    real(dp), intent(inout) :: before          !! largest remaining change at the last turn
    real(dp), intent(inout) :: change(s%nx)    !! [m/s] or its rates
    real(dp) :: largest
    integer :: i

    largest = maxval(abs(change))
    if (largest > SLOWLY*before) then
      do i = 1, s%nx
        slopes%lu(:, i) = -slopes%by_load*s%load_v(:, i) - slopes%by_p*s%p_v(:, i)
        slopes%lu(i, i) = slopes%lu(i, i) + 1.0_dp
      end do
      call decompose(s%nx, slopes%lu, slopes%pivot)
      slopes%factored = .true.
    end if
    if (slopes%factored) call solve(s%nx, slopes%lu, slopes%pivot, change)
    before = largest
  end subroutine turn

  !> Accelerations [m/s2].
  pure subroutine accelerate(s, f, slopes, acceleration)
    type(condensed_t), intent(in) :: s
    real(dp), intent(in) :: f(s%nx, 2)       !! from `rates_at`
    type(slopes_t), intent(inout) :: slopes
    real(dp), intent(out) :: acceleration(s%nx)

    acceleration = slopes%by_load*applied(s%nx, s%load_u, f(:, U)) + slopes%by_p*applied(s%nx, s%p_u, f(:, U)) &
                   + slopes%by_y*f(:, Y)
    call damp(s, slopes, acceleration)
    acceleration = acceleration + slopes%by_t
  end subroutine accelerate

  !> Whether inertia, speeds and contacts are within the limits of a phase.
  pure subroutine look(s, limits, t, q, slopes, within)
    type(condensed_t), intent(in) :: s
    type(limits_t), intent(in) :: limits
    real(dp), intent(in) :: t                 !! time [s]
    real(dp), intent(in) :: q(s%nx, 2)        !! u [m], y
    type(slopes_t), intent(inout) :: slopes   !! work space
    logical, intent(out) :: within
    real(dp) :: f(s%nx, 2), p(s%nx), inertia

    call rates_at(s, t, q, f, slopes, p, inertia)
    within = inertia <= limits%inertia .and. all(abs(f(:, U)) < limits%speed) .and. all((p > 0.0_dp) .eqv. s%closed)
  end subroutine look

  pure subroutine new_slopes(nx, slopes, complete)
    integer, intent(in) :: nx
    type(slopes_t), intent(out) :: slopes
    logical, intent(inout) :: complete
    integer :: failed

    allocate (slopes%by_load(nx), slopes%by_p(nx), slopes%by_y(nx), slopes%x_v(nx), slopes%x_y(nx), slopes%by_t(nx), &
              slopes%lu(nx, nx), slopes%pivot(nx), stat=failed)
    complete = complete .and. failed == 0
  end subroutine new_slopes

  pure function new_work(nx) result(w)
    integer, intent(in) :: nx
    type(work_t) :: w
    integer :: failed

    allocate (w%lu(nx, nx), w%pivot(nx), w%k(nx, 2, STAGES), w%poly(nx, 2, 3), w%q_new(nx, 2), stat=failed)
    w%complete = failed == 0
    call new_slopes(nx, w%slopes, w%complete)
    call new_slopes(nx, w%others, w%complete)
  end function new_work

  pure function new_condensed(nx, law, closed, load, load_u, load_v, load_a, p, p_u, p_v, p_a) result(s)
    integer, intent(in) :: nx
    type(law_t), intent(in) :: law
    logical, intent(in) :: closed(nx)      !! whether each block is in contact
    real(dp), intent(in) :: load(nx, 3)    !! see `condensed_t`
    real(dp), intent(in) :: load_u(nx, nx)
    real(dp), intent(in) :: load_v(nx, nx)
    real(dp), intent(in) :: load_a(nx, nx)
    real(dp), intent(in) :: p(nx, 3)
    real(dp), intent(in) :: p_u(nx, nx)
    real(dp), intent(in) :: p_v(nx, nx)
    real(dp), intent(in) :: p_a(nx, nx)
    type(condensed_t) :: s
    integer :: failed, i

    s%nx = nx
    s%law = law
    allocate (s%closed(nx), s%unit(nx), s%load(nx, 3), s%load_u(nx, nx), s%load_v(nx, nx), s%p(nx, 3), s%p_u(nx, nx), &
              s%p_v(nx, nx), s%load_a(nx, nx), s%p_a(nx, nx), stat=failed)
    s%complete = failed == 0
    if (.not. s%complete) return
    s%closed(:) = closed
    s%unit(:) = law%rate_state%d_c/law%rate_state%v_ref
    call logarithms(nx, s%unit)
    s%load(:, :) = load
    s%load_u(:, :) = load_u
    s%p(:, :) = p
    s%p_u(:, :) = p_u
    s%load_v(:, :) = load_v
    where (.not. closed) s%law%rate_state%stress = 0.0_dp
    do i = 1, nx
      s%law%rate_state%alpha(i) = s%law%rate_state%alpha(i) - load_v(i, i)
      s%load_v(i, i) = 0.0_dp
    end do
    s%p_v(:, :) = p_v
    s%load_a(:, :) = load_a
    s%p_a(:, :) = p_a
    s%inertial = any(abs(load_a) > 0.0_dp) .or. any(abs(p_a) > 0.0_dp)
    s%viscous = any(abs(load_v) > 0.0_dp) .or. any(abs(p_v) > 0.0_dp)
  end function new_condensed

  !> y of a law with a rate of stress, from ln(theta) and velocities. Velocities that are NaN are replaced by velocities at which
  !> friction balances the loads.
  pure subroutine begin_phase(s, w, v, q)
    type(condensed_t), intent(inout) :: s
    type(work_t), intent(inout) :: w
    real(dp), intent(inout) :: v(s%nx)        !! velocities [m/s]
    real(dp), intent(inout) :: q(s%nx, 2)     !! u [m]; on entry ln(theta), on return y
    real(dp) :: stress(s%nx), x(s%nx), slope(s%nx)

    if (.not. s%law%rate_state%stressed) return
    if (.not. all(abs(v) < huge(v))) then
      stress = s%law%rate_state%stress
      s%law%rate_state%stress = 0.0_dp
      call velocities(s, 0.0_dp, q, w, v)
      s%law%rate_state%stress = stress
    end if
    call from_log_theta(s%law%rate_state, 1, s%nx, q(:, Y), x, slope)
    call add_stress(s%law%rate_state, s%nx, v, x, q(:, Y))
  end subroutine begin_phase

  !> Velocities [m/s] and accelerations [m/s2] at the end of a phase or at a point. y is replaced by ln(theta).
  pure subroutine end_phase(s, t, w, q, v, acceleration)
    type(condensed_t), intent(in) :: s
    real(dp), intent(in) :: t                 !! time [s]
    type(work_t), intent(inout) :: w
    real(dp), intent(inout) :: q(s%nx, 2)     !! u [m]; on entry y, on return ln(theta)
    real(dp), intent(out) :: v(s%nx)
    real(dp), intent(out), optional :: acceleration(s%nx)

    call velocities(s, t, q, w, v, acceleration)
    call take_stress(s%law%rate_state, s%nx, v, q(:, Y))
  end subroutine end_phase

  !> Velocities [m/s], and accelerations without inertia [m/s2].
  pure subroutine velocities(s, t, q, w, v, acceleration)
    type(condensed_t), intent(in) :: s
    real(dp), intent(in) :: t                 !! time [s]
    real(dp), intent(in) :: q(s%nx, 2)        !! u [m], y
    type(work_t), intent(inout) :: w
    real(dp), intent(out) :: v(s%nx)
    real(dp), intent(out), optional :: acceleration(s%nx)
    real(dp) :: f(s%nx, 2), p(s%nx)

    call rates_at(s, t, q, f, w%others, p)
    v = f(:, U)
    if (present(acceleration)) call accelerate(s, f, w%others, acceleration)
  end subroutine velocities

  !> Decomposes the matrix of a step for increments of u. Increments of y are eliminated.
  pure subroutine prepare(s, inverse, slopes, lu, pivot)
    type(condensed_t), intent(in) :: s
    real(dp), intent(in) :: inverse             !! 1/(gamma h) [1/s]
    type(slopes_t), intent(in) :: slopes
    real(dp), intent(out) :: lu(s%nx, s%nx)
    integer, intent(out) :: pivot(s%nx)
    integer :: i

    do i = 1, s%nx
      lu(:, i) = -slopes%by_load*(s%load_u(:, i) + inverse*s%load_v(:, i)) - slopes%by_p*(s%p_u(:, i) + inverse*s%p_v(:, i))
    end do
    do i = 1, s%nx
      lu(i, i) = lu(i, i) + inverse*(1.0_dp - slopes%by_y(i)*slopes%x_v(i)/(inverse - slopes%x_y(i)))
    end do
    call decompose(s%nx, lu, pivot)
  end subroutine prepare

  !> Increments k of a stage from its right side.
  pure subroutine increments(s, inverse, slopes, lu, pivot, k)
    type(condensed_t), intent(in) :: s
    real(dp), intent(in) :: inverse             !! 1/(gamma h) [1/s]
    type(slopes_t), intent(in) :: slopes
    real(dp), intent(in) :: lu(s%nx, s%nx)
    integer, intent(in) :: pivot(s%nx)
    real(dp), intent(inout) :: k(s%nx, 2)       !! on entry the right side, on return increments
    real(dp) :: rest(s%nx)

    rest = (k(:, Y) - slopes%x_v*k(:, U))/(inverse - slopes%x_y)
    k(:, U) = k(:, U) - resisted(s, slopes, k(:, U)) + slopes%by_y*rest
    call solve(s%nx, lu, pivot, k(:, U))
    k(:, Y) = rest + slopes%x_v*inverse/(inverse - slopes%x_y)*k(:, U)
  end subroutine increments

  !> Makes one step: the state at the end of the step, polynomials inside the step, and the error over the allowed error.
  pure subroutine step(s, limits, t, h, q, w, error)
    type(condensed_t), intent(in) :: s
    type(limits_t), intent(in) :: limits
    real(dp), intent(in) :: t                     !! time [s]
    real(dp), intent(in) :: h                     !! length of the step [s]
    real(dp), intent(in) :: q(s%nx, 2)            !! u [m], y
    type(work_t), intent(inout) :: w              !! q_new and poly are set
    real(dp), intent(out) :: error
    real(dp) :: f(s%nx, 2), p(s%nx), by_t(s%nx, 2), inverse
    integer :: i, j

    inverse = 1.0_dp/(GAMMA*h)
    error = huge(error)
    call rates_at(s, t, q, f, w%slopes, p)
    by_t(:, U) = w%slopes%by_t
    by_t(:, Y) = w%slopes%x_v*w%slopes%by_t
    call prepare(s, inverse, w%slopes, w%lu, w%pivot)
    do i = 1, STAGES
      call stage_state(s%nx, i, q, w%k, w%q_new)
      if (i > 1) call rates_at(s, t + AT(i)*h, w%q_new, f, w%others, p)
      w%k(:, :, i) = f + h*BY_TIME(i)*by_t
      do j = 1, i - 1
        w%k(:, :, i) = w%k(:, :, i) + C(j, i)/h*w%k(:, :, j)
      end do
      call increments(s, inverse, w%slopes, w%lu, w%pivot, w%k(:, :, i))
      if (.not. all(abs(w%k(:, :, i)) < huge(h))) return
    end do
    w%q_new = w%q_new + w%k(:, :, STAGES)
    w%poly = 0.0_dp
    do j = 1, 3
      do i = 1, STAGES
        w%poly(:, :, j) = w%poly(:, :, j) + INSIDE(i, j)*w%k(:, :, i)
      end do
    end do
    error = over_allowed(s, limits, q, w%q_new, w%k(:, :, STAGES))
  end subroutine step

  !> The state at a stage, from the state before the step and the increments of earlier stages.
  pure subroutine stage_state(nx, i, q, k, q_stage)
    integer, intent(in) :: nx
    integer, intent(in) :: i                       !! stage
    real(dp), intent(in) :: q(nx, 2)               !! at the beginning of the step
    real(dp), intent(in) :: k(nx, 2, STAGES)
    real(dp), intent(inout) :: q_stage(nx, 2)
    integer :: j

    if (i > ubound(A, 2)) then
      q_stage = q_stage + k(:, :, i - 1)
      return
    end if
    q_stage = q
    do j = 1, i - 1
      q_stage = q_stage + A(j, i)*k(:, :, j)
    end do
  end subroutine stage_state

  !> Root mean square of errors over allowed errors.
  pure function over_allowed(s, limits, q, q_new, errors) result(error)
    type(condensed_t), intent(in) :: s
    type(limits_t), intent(in) :: limits
    real(dp), intent(in) :: q(s%nx, 2)
    real(dp), intent(in) :: q_new(s%nx, 2)
    real(dp), intent(in) :: errors(s%nx, 2)
    real(dp) :: error, extent(s%nx, 2)
    integer :: i, j

    extent(:, U) = max(abs(q(:, U)), abs(q_new(:, U)))
    extent(:, Y) = max(abs(q(:, Y) - s%unit), abs(q_new(:, Y) - s%unit))
    error = 0.0_dp
    do j = 1, 2
      do i = 1, s%nx
        error = error + (errors(i, j)/(limits%absolute(j) + limits%relative*extent(i, j)))**2
      end do
    end do
    error = sqrt(error/(2*s%nx))
  end function over_allowed

  !> The state at a share of a step.
  pure function inside_step(nx, share, q, q_new, poly) result(at_share)
    integer, intent(in) :: nx
    real(dp), intent(in) :: share              !! from 0 to 1
    real(dp), intent(in) :: q(nx, 2)
    real(dp), intent(in) :: q_new(nx, 2)
    real(dp), intent(in) :: poly(nx, 2, 3)     !! from `step`
    real(dp) :: at_share(nx, 2), other

    other = 1.0_dp - share
    at_share = other*q + share*(q_new + other*(poly(:, :, 1) + share*(poly(:, :, 2) + share*poly(:, :, 3))))
  end function inside_step

  !> Length of the next step, after a step of length h with this error.
  pure function next_length(h, error) result(next)
    real(dp), intent(in) :: h              !! length of the step [s]
    real(dp), intent(in) :: error          !! error over the allowed error
    real(dp) :: next, change(1)

    change = min(max(error, 1e-10_dp), 1e10_dp)
    call logarithms(1, change)
    change = -0.2_dp*change
    call exponentials(1, change)
    next = h*min(max(SAFE*change(1), SHORTER), LONGER)
  end function next_length

  !> Makes steps until a limit is reached or there is no room for more passages. Fills points and passages.
  pure subroutine advance_phase(s, limits, n_points, times, w, phase, points, passages, status)
    type(condensed_t), intent(in) :: s
    type(limits_t), intent(in) :: limits
    integer, intent(in) :: n_points                       !! number of points of the curve
    real(dp), intent(in) :: times(n_points)               !! times of the points since the beginning, ascending [s]
    type(work_t), intent(inout) :: w
    type(phase_t), intent(inout) :: phase
    real(dp), intent(inout) :: points(s%nx, 2, n_points)  !! u [m], y
    type(passages_t), intent(inout) :: passages
    integer(ip), intent(out) :: status
    real(dp) :: h, planned, error, share
    logical :: within

    status = FAST
    call look(s, limits, phase%t, phase%q, w%others, within)
    if (.not. within) return
    do while (phase%steps < limits%steps .and. passages%n + s%nx <= size(passages%of, 2))
      planned = phase%h
      h = min(planned, limits%end - phase%t)
      call step(s, limits, phase%t, h, phase%q, w, error)
      phase%h = next_length(h, error)
      status = ABRUPT
      if (.not. error <= 1.0_dp) then
        if (h <= max(limits%dt, limits%least)) return
        cycle
      end if
      if (h < planned) phase%h = max(planned, phase%h)
      phase%steps = phase%steps + 1
      status = merge(FINISHED, GOES_ON, h >= limits%end - phase%t)
      share = 1.0_dp
      call look(s, limits, phase%t + h, w%q_new, w%others, within)
      if (.not. within) then
        status = FAST
        call share_within(s, limits, phase%t, h, phase%q, w, share)
      else if (status == GOES_ON .and. h < limits%least .and. phase%h <= h) then
        status = SHORT
      end if
      if (passages%threshold > 0.0_dp) call find_passages(s, phase, h, share, w, passages)
      call take(s%nx, limits, h, share, w%q_new, w%poly, status == FINISHED, phase, n_points, times, points)
      if (phase%t >= limits%last) status = FINISHED
      if (status /= GOES_ON) return
    end do
  end subroutine advance_phase

  !> The largest share of a step within the limits, by halving.
  pure subroutine share_within(s, limits, t, h, q, w, low)
    type(condensed_t), intent(in) :: s
    type(limits_t), intent(in) :: limits
    real(dp), intent(in) :: t                  !! time [s]
    real(dp), intent(in) :: h                  !! length of the step [s]
    real(dp), intent(in) :: q(s%nx, 2)
    type(work_t), intent(inout) :: w
    real(dp), intent(out) :: low
    real(dp) :: high, middle
    logical :: within
    integer :: n

    low = 0.0_dp
    high = 1.0_dp
    do n = 1, HALVINGS
      if ((high - low)*h < limits%dt) exit
      middle = 0.5_dp*(low + high)
      call look(s, limits, t + middle*h, inside_step(s%nx, middle, q, w%q_new, w%poly), w%others, within)
      low = merge(middle, low, within)
      high = merge(high, middle, within)
    end do
  end subroutine share_within

  !> Finds the passages in a share of a step.
  pure subroutine find_passages(s, phase, h, share, w, passages)
    type(condensed_t), intent(in) :: s
    type(phase_t), intent(in) :: phase         !! at the beginning of the step
    real(dp), intent(in) :: h                  !! length of the step [s]
    real(dp), intent(in) :: share
    type(work_t), intent(inout) :: w
    type(passages_t), intent(inout) :: passages
    real(dp) :: q(s%nx, 2), v(s%nx, 2), at, total
    integer(ip) :: now
    integer :: i

    call velocities(s, phase%t, phase%q, w, v(:, 1))
    q = inside_step(s%nx, share, phase%q, w%q_new, w%poly)
    call velocities(s, phase%t + share*h, q, w, v(:, 2))
    total = 0.0_dp
    do i = 1, s%nx
      total = total + v(i, 2)
      now = 0
      if (abs(v(i, 2)) > passages%threshold) now = merge(1_ip, -1_ip, v(i, 2) > 0.0_dp)
      if (now == passages%fast(i)) cycle
      at = 0.0_dp
      if ((abs(v(i, 1)) > passages%threshold) .neqv. now /= 0) then
        call pass(s, phase, h, share, i, passages%threshold, [abs(v(i, 1)), abs(v(i, 2))], w, at)
      end if
      q = inside_step(s%nx, at, phase%q, w%q_new, w%poly)
      passages%n = passages%n + 1
      passages%fast(i) = now
      passages%of(:, passages%n) = [int(i - 1, ip), now]
      passages%at(1, passages%n) = phase%t + at*h
      passages%at(2, passages%n) = normal_force(s, phase%t + at*h, q, i)
      passages%at(3:, passages%n) = q(:, U)
    end do
    if (phase%steps <= size(passages%sums, 2)) passages%sums(:, phase%steps) = [phase%t + share*h, abs(total)]
  end subroutine find_passages

  !> The share of a step at which a block has the speed `threshold`, by regula falsi. An end of the interval that does not move
  !> loses weight in each iteration.
  pure subroutine pass(s, phase, h, share, i, threshold, speeds, w, at)
    type(condensed_t), intent(in) :: s
    type(phase_t), intent(in) :: phase         !! at the beginning of the step
    real(dp), intent(in) :: h                  !! length of the step [s]
    real(dp), intent(in) :: share
    integer, intent(in) :: i                   !! block
    real(dp), intent(in) :: threshold          !! speed above which a block is fast [m/s]
    real(dp), intent(in) :: speeds(2)          !! at the beginning and at the share [m/s]
    type(work_t), intent(inout) :: w
    real(dp), intent(out) :: at
    real(dp) :: ends(2), above(2), found, v(s%nx)
    integer :: n

    ends = [0.0_dp, share]
    above = speeds - threshold
    do n = 1, MOST
      at = ends(2) - above(2)*(ends(2) - ends(1))/(above(2) - above(1))
      call velocities(s, phase%t + at*h, inside_step(s%nx, at, phase%q, w%q_new, w%poly), w, v)
      found = abs(v(i)) - threshold
      if (abs(found) <= 4*epsilon(found)*threshold .or. abs(ends(2) - ends(1)) <= 4*epsilon(at)*share) return
      if ((found > 0.0_dp) .neqv. above(2) > 0.0_dp) then
        ends(1) = ends(2)
        above(1) = above(2)
      else
        above(1) = 0.5_dp*above(1)
      end if
      ends(2) = at
      above(2) = found
    end do
  end subroutine pass

  !> Normal force of a block [N].
  pure function normal_force(s, t, q, i) result(p)
    type(condensed_t), intent(in) :: s
    real(dp), intent(in) :: t                 !! time [s]
    real(dp), intent(in) :: q(s%nx, 2)        !! u [m], y
    integer, intent(in) :: i
    real(dp) :: p
    integer :: j

    p = s%p(i, 1) + t*(s%p(i, 2) + 0.5_dp*t*s%p(i, 3))
    do j = 1, s%nx
      p = p + s%p_u(i, j)*q(j, U)
    end do
  end function normal_force

  !> Stores a share of a step: points inside the share, the last time on the grid, and the state at the end of the share.
  pure subroutine take(nx, limits, h, share, q_new, poly, at_end, phase, n_points, times, points)
    integer, intent(in) :: nx
    type(limits_t), intent(in) :: limits
    real(dp), intent(in) :: h                  !! length of the step [s]
    real(dp), intent(in) :: share
    real(dp), intent(in) :: q_new(nx, 2)
    real(dp), intent(in) :: poly(nx, 2, 3)
    logical, intent(in) :: at_end              !! whether the share ends at the end of the phase
    type(phase_t), intent(inout) :: phase
    integer, intent(in) :: n_points
    real(dp), intent(in) :: times(n_points)               !! times of the points [s]
    real(dp), intent(inout) :: points(nx, 2, n_points)
    real(dp) :: t_new, on_grid

    t_new = merge(limits%end, phase%t + share*h, at_end)
    do while (phase%n_points < n_points)
      on_grid = times(phase%n_points + 1)
      if (on_grid > t_new) exit
      phase%n_points = phase%n_points + 1
      points(:, :, phase%n_points) = inside_step(nx, min((on_grid - phase%t)/h, 1.0_dp), phase%q, q_new, poly)
    end do
    on_grid = min(merge(limits%end, aint(t_new/limits%dt)*limits%dt, at_end), limits%last)
    if (on_grid >= phase%t .and. on_grid > phase%t_grid) then
      phase%t_grid = on_grid
      phase%grid = inside_step(nx, min((on_grid - phase%t)/h, 1.0_dp), phase%q, q_new, poly)
    end if
    phase%t = t_new
    phase%q = merge(inside_step(nx, share, phase%q, q_new, poly), q_new, share < 1.0_dp)
  end subroutine take
end module pyfric_slow_slip
