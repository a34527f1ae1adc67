!> The log of a run: switches of single blocks, the interface at each start and end of slip, and points of the loading curve.
module pyfric_log
  use pyfric_kinds, only: dp, ip
  use pyfric_energy, only: N_POINT
  implicit none (type, external)
  private
  public :: log_t, new_log, save_log, log_switch, log_quiet, log_point, has_room

  type :: log_t
    integer :: n_switch = 0
    integer :: n_quiet = 0
    logical :: complete = .false.   !! there was enough memory
    integer(ip), allocatable :: switch_i(:, :)    !! block from 0, old state, new state, corner
    real(dp), allocatable :: switch_r(:, :)       !! step, time [s], u_x [m], p [N]
    integer(ip), allocatable :: quiet_i(:, :)     !! +1 first slip or -1 last stick, then contact states
    real(dp), allocatable :: quiet_r(:, :)        !! step, time [s], F_T [N], then u_x [m]
    integer :: every = 0                          !! steps between two points of the loading curve; 0: none
    integer :: n_point = 0
    real(dp), allocatable :: points(:, :)         !! after each multiple of `every` steps, see pyfric_energy
  end type log_t

contains

  pure function new_log(nx, switches, quiet, every, points) result(log)
    integer, intent(in) :: nx          !! blocks
    integer, intent(in) :: switches    !! room for switches
    integer, intent(in) :: quiet       !! and for quiet transitions
    integer, intent(in) :: every       !! steps between two points of the loading curve; 0: none
    integer, intent(in) :: points      !! room for them
    type(log_t) :: log
    integer :: failed

    allocate (log%switch_i(4, switches), log%switch_r(4, switches), &
              log%quiet_i(nx + 1, quiet), log%quiet_r(nx + 3, quiet), log%points(N_POINT, points), stat=failed)
    log%every = every
    log%complete = failed == 0
  end function new_log

  !> The entries as the plain arrays that Python keeps.
  pure subroutine save_log(log, n_log, switch_i, switch_r, quiet_i, quiet_r, points)
    type(log_t), intent(in) :: log
    integer(ip), intent(out) :: n_log(3)           !! switches, quiet transitions and points
    integer(ip), intent(inout) :: switch_i(:, :)   !! these: see log_t
    real(dp), intent(inout) :: switch_r(:, :)
    integer(ip), intent(inout) :: quiet_i(:, :)
    real(dp), intent(inout) :: quiet_r(:, :)
    real(dp), intent(inout) :: points(:, :)

    n_log = [log%n_switch, log%n_quiet, log%n_point]
    switch_i(:, :n_log(1)) = log%switch_i(:, :n_log(1))
    switch_r(:, :n_log(1)) = log%switch_r(:, :n_log(1))
    quiet_i(:, :n_log(2)) = log%quiet_i(:, :n_log(2))
    quiet_r(:, :n_log(2)) = log%quiet_r(:, :n_log(2))
    points(:, :n_log(3)) = log%points(:, :n_log(3))
  end subroutine save_log

  !> True if the log has room for so many more entries.
  pure function has_room(log, switches, quiet) result(yes)
    type(log_t), intent(in) :: log
    integer, intent(in) :: switches
    integer, intent(in) :: quiet
    logical :: yes

    yes = log%n_switch + switches <= size(log%switch_r, 2) .and. log%n_quiet + quiet <= size(log%quiet_r, 2) &
          .and. (log%every == 0 .or. log%n_point < size(log%points, 2))
  end function has_room

  !> Logs a switch of block i.
  pure subroutine log_switch(log, i, old, new, corner, step, t, u_x, p)
    type(log_t), intent(inout) :: log
    integer, intent(in) :: i            !! block, from 1
    integer(ip), intent(in) :: old      !! contact state before
    integer(ip), intent(in) :: new      !! contact state after
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

  !> Logs that the first block slips, or that the last one has stopped.
  pure subroutine log_quiet(log, active, mode, step, t, f_t, u_x)
    type(log_t), intent(inout) :: log
    logical, intent(in) :: active       !! a block slips
    integer(ip), intent(in) :: mode(:)  !! contact states
    real(dp), intent(in) :: step        !! steps made
    real(dp), intent(in) :: t           !! time [s]
    real(dp), intent(in) :: f_t         !! driver force [N]
    real(dp), intent(in) :: u_x(:)      !! displacements of the bottom row [m]

    log%n_quiet = log%n_quiet + 1
    log%quiet_i(1, log%n_quiet) = merge(1_ip, -1_ip, active)
    log%quiet_i(2:, log%n_quiet) = mode
    log%quiet_r(1:3, log%n_quiet) = [step, t, f_t]
    log%quiet_r(4:, log%n_quiet) = u_x
  end subroutine log_quiet
end module pyfric_log
