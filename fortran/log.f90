!> The log of a run: switches of single blocks, the interface at each start and end of slip, and points of the loading curve.
!>
!> With a threshold of speed, the log also has crossings and bursts. Crossings are passages of single blocks through the threshold,
!> in the form of switches. Bursts are the interface at each start and end of fast slip, in the form of starts and ends of slip.
module pyfric_log
  use pyfric_kinds, only: dp, ip
  use pyfric_energy, only: N_POINT
  implicit none (type, external)
  private
  public :: log_t, new_log, watch_speeds, save_log, save_speeds, has_room
  public :: log_switch, log_quiet, log_budget, log_speeds, log_burst, log_point

  type :: log_t
    integer :: n_switch = 0
    integer :: n_quiet = 0
    logical :: complete = .false.   !! whether memory was allocated
    integer(ip), allocatable :: switch_i(:, :)    !! block from 0, old state, new state, corner
    real(dp), allocatable :: switch_r(:, :)       !! step, time [s], u_x [m], p [N]
    integer(ip), allocatable :: quiet_i(:, :)     !! +1 first slip or -1 last stick, then contact states
    real(dp), allocatable :: quiet_r(:, :)        !! step, time [s], a point of the loading curve, then u_x [m]
    integer :: every = 0                          !! steps between two points of the loading curve; 0: none
    integer :: n_point = 0
    real(dp), allocatable :: points(:, :)         !! points after each multiple of `every` steps, see pyfric_energy
    real(dp) :: threshold = 0.0_dp                !! speed above which a block is fast [m/s]; 0: no threshold
    integer :: n_crossing = 0
    integer :: n_burst = 0
    integer(ip), allocatable :: fast(:, :)        !! +1, -1 fast to the right, left, 0 slow; 1: corner slip
    real(dp), allocatable :: speeds(:)            !! v_x at the end of the last step; largest |sum of v_x| in this burst [m/s]
    integer(ip), allocatable :: crossing_i(:, :)  !! columns as in switch_i
    real(dp), allocatable :: crossing_r(:, :)     !! columns as in switch_r
    integer(ip), allocatable :: burst_i(:, :)     !! columns as in quiet_i
    real(dp), allocatable :: burst_r(:, :)        !! columns as in quiet_r, then the largest |sum of v_x| [m/s]
  end type log_t

contains

  pure function new_log(nx, switches, quiet, every, points) result(log)
    integer, intent(in) :: nx          !! blocks
    integer, intent(in) :: switches    !! largest number of switches
    integer, intent(in) :: quiet       !! largest number of starts and ends of slip
    integer, intent(in) :: every       !! steps between two points of the loading curve; 0: none
    integer, intent(in) :: points      !! largest number of points
    type(log_t) :: log
    integer :: failed

    allocate (log%switch_i(4, switches), log%switch_r(4, switches), &
              log%quiet_i(nx + 1, quiet), log%quiet_r(nx + 2 + N_POINT, quiet), log%points(N_POINT, points), stat=failed)
    log%every = every
    log%complete = failed == 0
  end function new_log

  !> Prepares the log for crossings and bursts.
  pure subroutine watch_speeds(log, threshold, crossings, bursts, fast, speeds)
    type(log_t), intent(inout) :: log
    real(dp), intent(in) :: threshold    !! speed above which a block is fast [m/s]
    integer, intent(in) :: crossings     !! largest number of passages of blocks
    integer, intent(in) :: bursts        !! largest number of starts and ends of fast slip
    integer(ip), intent(in) :: fast(:, :)  !! this array and the next: see log_t
    real(dp), intent(in) :: speeds(:)
    integer :: nx, failed

    nx = size(fast, 1)
    log%threshold = threshold
    allocate (log%crossing_i(4, crossings), log%crossing_r(4, crossings), log%burst_i(nx + 1, bursts), &
              log%burst_r(nx + 3 + N_POINT, bursts), log%fast(nx, 2), log%speeds(nx + 1), stat=failed)
    log%complete = log%complete .and. failed == 0
    if (failed /= 0) return
    log%fast(:, :) = fast
    log%speeds(:) = speeds
  end subroutine watch_speeds

  !> Copies the entries to the plain arrays of Python.
  pure subroutine save_log(log, n_log, switch_i, switch_r, quiet_i, quiet_r, points)
    type(log_t), intent(in) :: log
    integer(ip), intent(out) :: n_log(5)           !! numbers of switches, starts and ends of slip, points, crossings, bursts
    integer(ip), intent(inout) :: switch_i(:, :)   !! this array and the next ones: see log_t
    real(dp), intent(inout) :: switch_r(:, :)
    integer(ip), intent(inout) :: quiet_i(:, :)
    real(dp), intent(inout) :: quiet_r(:, :)
    real(dp), intent(inout) :: points(:, :)

    n_log = [log%n_switch, log%n_quiet, log%n_point, log%n_crossing, log%n_burst]
    switch_i(:, :n_log(1)) = log%switch_i(:, :n_log(1))
    switch_r(:, :n_log(1)) = log%switch_r(:, :n_log(1))
    quiet_i(:, :n_log(2)) = log%quiet_i(:, :n_log(2))
    quiet_r(:, :n_log(2)) = log%quiet_r(:, :n_log(2))
    points(:, :n_log(3)) = log%points(:, :n_log(3))
  end subroutine save_log

  !> Copies the entries of fast slip to the plain arrays of Python.
  pure subroutine save_speeds(log, fast, speeds, crossing_i, crossing_r, burst_i, burst_r)
    type(log_t), intent(in) :: log
    integer(ip), intent(inout) :: fast(:, :)       !! this array and the next ones: see log_t
    real(dp), intent(inout) :: speeds(:)
    integer(ip), intent(inout) :: crossing_i(:, :)
    real(dp), intent(inout) :: crossing_r(:, :)
    integer(ip), intent(inout) :: burst_i(:, :)
    real(dp), intent(inout) :: burst_r(:, :)

    if (.not. log%threshold > 0.0_dp) return
    fast = log%fast
    speeds = log%speeds
    crossing_i(:, :log%n_crossing) = log%crossing_i(:, :log%n_crossing)
    crossing_r(:, :log%n_crossing) = log%crossing_r(:, :log%n_crossing)
    burst_i(:, :log%n_burst) = log%burst_i(:, :log%n_burst)
    burst_r(:, :log%n_burst) = log%burst_r(:, :log%n_burst)
  end subroutine save_speeds

  !> Whether the log has room for given numbers of additional entries.
  pure function has_room(log, switches, quiet) result(yes)
    type(log_t), intent(in) :: log
    integer, intent(in) :: switches
    integer, intent(in) :: quiet
    logical :: yes

    yes = log%n_switch + switches <= size(log%switch_r, 2) .and. log%n_quiet + quiet <= size(log%quiet_r, 2) &
          .and. (log%every == 0 .or. log%n_point < size(log%points, 2))
    if (yes .and. log%threshold > 0.0_dp) then
      yes = log%n_crossing + size(log%fast, 1) <= size(log%crossing_r, 2) .and. log%n_burst < size(log%burst_r, 2)
    end if
  end function has_room

  !> Logs a switch of block i.
  pure subroutine log_switch(log, i, old, new, corner, step, t, u_x, p)
    type(log_t), intent(inout) :: log
    integer, intent(in) :: i            !! block, from 1
    integer(ip), intent(in) :: old      !! old contact state
    integer(ip), intent(in) :: new      !! new contact state
    integer(ip), intent(in) :: corner   !! 1: corner episode
    real(dp), intent(in) :: step        !! steps made
    real(dp), intent(in) :: t           !! time [s]
    real(dp), intent(in) :: u_x         !! displacement [m]
    real(dp), intent(in) :: p           !! foundation force [N]

    log%n_switch = log%n_switch + 1
    log%switch_i(:, log%n_switch) = [int(i - 1, ip), old, new, corner]
    log%switch_r(:, log%n_switch) = [step, t, u_x, p]
  end subroutine log_switch

  !> Logs a point of the loading curve.
  pure subroutine log_point(log, point)
    type(log_t), intent(inout) :: log
    real(dp), intent(in) :: point(N_POINT)

    log%n_point = log%n_point + 1
    log%points(:, log%n_point) = point
  end subroutine log_point

  !> Logs the interface at a start of slip, or at the end of all slip.
  pure subroutine log_quiet(log, active, mode, step, t, f_t, u_x)
    type(log_t), intent(inout) :: log
    logical, intent(in) :: active       !! whether a block slips
    integer(ip), intent(in) :: mode(:)  !! contact states
    real(dp), intent(in) :: step        !! steps made
    real(dp), intent(in) :: t           !! time [s]
    real(dp), intent(in) :: f_t         !! driver force [N]
    real(dp), intent(in) :: u_x(:)      !! displacements of the bottom row [m]

    log%n_quiet = log%n_quiet + 1
    log%quiet_i(1, log%n_quiet) = merge(1_ip, -1_ip, active)
    log%quiet_i(2:, log%n_quiet) = mode
    log%quiet_r(1:3, log%n_quiet) = [step, t, f_t]
    log%quiet_r(4:2 + N_POINT, log%n_quiet) = 0.0_dp
    log%quiet_r(3 + N_POINT:, log%n_quiet) = u_x
  end subroutine log_quiet

  !> Adds the energies of a point of the loading curve to all logged starts and ends of slip after the first n.
  pure subroutine log_budget(log, n, point)
    type(log_t), intent(inout) :: log
    integer, intent(in) :: n
    real(dp), intent(in) :: point(N_POINT)
    integer :: k

    do k = n + 1, log%n_quiet
      log%quiet_r(4:2 + N_POINT, k) = point(2:)
    end do
  end subroutine log_budget

  !> Logs the blocks that passed the threshold in a step. Times are interpolated within the step. Open blocks are not fast.
  pure subroutine log_speeds(log, mode, step, t, dt, v, u_x, p, p_corner, turned)
    type(log_t), intent(inout) :: log
    integer(ip), intent(in) :: mode(:)   !! contact states
    real(dp), intent(in) :: step         !! steps made
    real(dp), intent(in) :: t            !! time [s]
    real(dp), intent(in) :: dt           !! step [s]
    real(dp), intent(in) :: v(:)         !! velocities of the bottom row [m/s]
    real(dp), intent(in) :: u_x(:)       !! displacements of the bottom row [m]
    real(dp), intent(in) :: p(:)         !! foundation forces [N]
    real(dp), intent(in) :: p_corner     !! foundation force below which slip is corner slip [N]
    logical, intent(out) :: turned       !! whether fast slip began or ended
    integer(ip) :: old, new
    integer :: i, nx
    real(dp) :: back
    logical :: was

    nx = size(mode)
    was = bursting(log)
    do i = 1, nx
      old = log%fast(i, 1)
      new = 0_ip
      if (abs(v(i)) > log%threshold .and. abs(mode(i)) <= 1) new = int(sign(1.0_dp, v(i)), ip)
      if (new == old) cycle
      back = 0.0_dp
      if (old == 0 .and. abs(v(i)) > abs(log%speeds(i))) then
        back = (abs(v(i)) - log%threshold)/(abs(v(i)) - abs(log%speeds(i)))
      else if (new == 0 .and. abs(v(i)) < log%threshold) then
        back = (log%threshold - abs(v(i)))/(abs(log%speeds(i)) - abs(v(i)))
      end if
      if (old == 0) log%fast(i, 2) = merge(1_ip, 0_ip, p(i) < p_corner)
      log%fast(i, 1) = new
      log%n_crossing = log%n_crossing + 1
      log%crossing_i(:, log%n_crossing) = [int(i - 1, ip), old, new, log%fast(i, 2)]
      log%crossing_r(:, log%n_crossing) = [step, t - min(max(back, 0.0_dp), 1.0_dp)*dt, u_x(i), p(i)]
    end do
    log%speeds(:nx) = v
    if (was .or. bursting(log)) log%speeds(nx + 1) = max(log%speeds(nx + 1), abs(sum(v)))
    turned = bursting(log) .neqv. was
  end subroutine log_speeds

  !> Whether a block is fast, without corner slip.
  pure function bursting(log) result(yes)
    type(log_t), intent(in) :: log
    logical :: yes

    yes = any(log%fast(:, 1) /= 0 .and. log%fast(:, 2) == 0)
  end function bursting

  !> Logs the interface when fast slip begins or ends.
  pure subroutine log_burst(log, mode, step, t, point, u_x)
    type(log_t), intent(inout) :: log
    integer(ip), intent(in) :: mode(:)         !! contact states
    real(dp), intent(in) :: step               !! steps made
    real(dp), intent(in) :: t                  !! time [s]
    real(dp), intent(in) :: point(N_POINT)     !! see pyfric_energy
    real(dp), intent(in) :: u_x(:)             !! displacements of the bottom row [m]
    integer :: nx

    nx = size(mode)
    log%n_burst = log%n_burst + 1
    log%burst_i(1, log%n_burst) = merge(1_ip, -1_ip, bursting(log))
    log%burst_i(2:, log%n_burst) = mode
    log%burst_r(:, log%n_burst) = [step, t, point, u_x, log%speeds(nx + 1)]
    if (.not. bursting(log)) log%speeds(nx + 1) = 0.0_dp
  end subroutine log_burst
end module pyfric_log
