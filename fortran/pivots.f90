!> Contact states on the condensed slider by pivots of a table, in compiled loops. pyfric.statics.complementarity makes the same
!> pivots in Python.
!>
!> The table gives u_x, f, u_z and F_T as affine functions of u_x of the held blocks and of the driver's position:
!>
!>     (u_x, f, u_z, F_T) = table (u_x, drive, 1) ,   f_i = -sigma_i slide_i p_i of free blocks ,   p = -k_f (u_z + gap) .
!>
!> `slide` is the friction of a slipping block over p. When a block i is released, its u_x is exchanged with
!> f + sigma slide p = 0. With the pivot a in its row r, and the column c of the other rows,
!>
!>     r -> -r/a ,  r_i -> 1/a ,  table -> table + c r .
!>
!> With all blocks held, u_z follows from (S_zz + k_f) u_z = loads - S_zx u_x, and f = S_xx u_x + S_xz u_z - loads.
!>
!> Source: R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem (1992), for pivots.
module pyfric_pivots
  use pyfric_kinds, only: dp, ip
  use pyfric_dense, only: decompose, solve, cholesky, solve_rows
  use pyfric_law, only: STUCK, OPEN_GAP
  use pyfric_status, only: DONE, NO_MEMORY, UNSUPPORTED, UNHELD
  implicit none (type, external)
  private
  public :: slider_t, ground_t, values_t, contact_t, new_contact, new_values, look, rates, put, change, hold_all, renew, find_ends
  public :: make_base, test_definite, BARE, KEPT

  integer(ip), parameter :: BARE = 3  !! contact state of a block that touches the foundation without friction
  integer, parameter :: KEPT = 2      !! number of stored tables with all blocks held, for the last sets of blocks in contact

  !> The slider condensed onto its interface, and its loads along each route of a protocol.
  type :: slider_t
    logical :: complete = .false.           !! whether memory was allocated
    integer :: nx                           !! blocks along the interface
    real(dp) :: k                           !! stiffness of bonds [N/m]
    real(dp) :: k_driver                    !! K of the driver [N/m]
    real(dp) :: unit                        !! F_N/N_x [N]
    real(dp) :: rounded                     !! largest violation of conditions by rounding, over `unit`
    real(dp) :: least                       !! normal force below which a block does not stick [N]
    real(dp) :: lost                        !! rounding errors above which the slider counts as not held [N]
    real(dp), allocatable :: s(:, :)        !! stiffness of u_x and u_z, 2 N_x each way [N/m]
    real(dp), allocatable :: drive(:)       !! load on u_x and u_z per motion of the driver, 2 N_x [N/m]
    real(dp), allocatable :: loads(:, :, :) !! load per motion of the driver, and constant load, of each route [N/m, N]
    real(dp), allocatable :: f_t(:, :)      !! F_T at u = 0, per motion of the driver, and constant [N/m, N]
  end type slider_t

  !> The foundation and its friction under each block.
  type :: ground_t
    real(dp), allocatable :: hold(:)        !! strength of a stuck block over p
    real(dp), allocatable :: slide(:)       !! friction of a slipping block over p
    real(dp), allocatable :: k_f(:)         !! stiffness of the foundation [N/m]
    real(dp), allocatable :: gap(:)         !! height of the blocks over the foundation at u_z = 0 [m]
    logical, allocatable :: touches(:)      !! whether a block can touch the foundation
    logical, allocatable :: rubs(:)         !! whether a block has friction on the foundation
  end type ground_t

  !> The interface in a static state, or its derivatives by the path length of the driver.
  type :: values_t
    real(dp), allocatable :: u_x(:)         !! displacements of the blocks [m]
    real(dp), allocatable :: f(:)           !! friction force along +x [N]
    real(dp), allocatable :: u_z(:)         !! vertical displacements of the blocks [m]
    real(dp), allocatable :: p(:)           !! foundation force [N]
    real(dp) :: f_t = 0.0_dp                !! force of the driver [N]
  end type values_t

  type :: contact_t
    integer(ip) :: status = DONE            !! see pyfric_status
    integer :: route = 1                    !! number of the route of the loads
    integer :: way = 1                      !! direction of the driver
    integer :: base = 1                     !! number of the stored table that is in use
    real(dp) :: tol = 0.0_dp                !! largest violation of conditions by rounding [N]
    logical :: known = .false.              !! whether `now` is up to date
    integer :: ends(2) = [1, 0]             !! first and last free block
    integer(ip), allocatable :: mode(:)     !! 0 stuck, +1 or -1 slips, 2 open, 3 bare
    logical, allocatable :: free(:)         !! blocks that are free in the table: slipping, open or bare
    real(dp), allocatable :: column(:)      !! u_x of held blocks [m], drive [m], 1
    real(dp), allocatable :: table(:, :)    !! rows u_x, f, u_z, F_T; columns u_x, drive, 1
    integer(ip), allocatable :: sets(:, :)  !! 1 for blocks in contact, for each stored table; -1: no table
    real(dp), allocatable :: bases(:, :, :) !! stored tables with all blocks held
    real(dp), allocatable :: squares(:, :, :) !! work space
    real(dp), allocatable :: sides(:, :, :) !! work space
    type(values_t) :: now                   !! static state, from `look`
  end type contact_t

contains

  pure subroutine new_values(nx, v, status)
    integer, intent(in) :: nx
    type(values_t), intent(inout) :: v
    integer(ip), intent(inout) :: status    !! NO_MEMORY if memory could not be allocated
    integer :: failed

    allocate (v%u_x(nx), v%f(nx), v%u_z(nx), v%p(nx), stat=failed)
    if (failed /= 0) status = NO_MEMORY
  end subroutine new_values

  !> Room for the contact states of one interface. The status is NO_MEMORY without memory.
  pure function new_contact(nx) result(c)
    integer, intent(in) :: nx
    type(contact_t) :: c
    integer :: failed

    allocate (c%mode(nx), c%free(nx), c%column(nx + 2), c%table(3*nx + 1, nx + 2), c%sets(nx, KEPT), &
              c%bases(3*nx + 1, nx + 2, KEPT), c%squares(nx, nx, 4), c%sides(3*nx + 1, nx + 2, 2), stat=failed)
    c%status = merge(DONE, NO_MEMORY, failed == 0)
    call new_values(nx, c%now, c%status)
  end function new_contact

  !> Indices of the n members of a set.
  pure function members(n, set) result(at)
    integer, intent(in) :: n
    logical, intent(in) :: set(:)
    integer :: at(n), i, found

    found = 0
    do i = 1, size(set)
      if (set(i)) found = found + 1
      if (set(i)) at(found) = i
    end do
  end function members

  !> New state of a block for a requested state. A block without friction becomes bare instead of stuck or slipping. A block that
  !> never touches the foundation stays open.
  elemental function possible(touches, rubs, mode) result(new)
    logical, intent(in) :: touches
    logical, intent(in) :: rubs
    integer(ip), intent(in) :: mode
    integer(ip) :: new

    new = mode
    if (.not. rubs .and. mode /= OPEN_GAP) new = BARE
    if (.not. touches) new = OPEN_GAP
  end function possible

  !> Direction of slip; 0 for blocks that do not slip.
  elemental function way_of(mode) result(way)
    integer(ip), intent(in) :: mode
    integer(ip) :: way

    way = merge(mode, 0_ip, abs(mode) == 1)
  end function way_of

  ! --- values --------------------------------------------------------------------------------------

  !> Computes the static state at the present position of the driver, unless `now` is up to date.
  pure subroutine look(s, g, c)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    real(dp) :: v(3*s%nx + 1)
    integer :: j, n

    if (c%known) return
    n = s%nx
    v(:n) = c%column(:n)
    v(c%ends(1):c%ends(2)) = 0.0_dp
    v(n + 1:) = 0.0_dp
    do j = 1, n + 2
      if (c%free(min(j, n)) .and. j <= n) cycle  ! u_x of free blocks is no input
      v(c%ends(1):c%ends(2)) = v(c%ends(1):c%ends(2)) + c%column(j)*c%table(c%ends(1):c%ends(2), j)
      v(n + 1:) = v(n + 1:) + c%column(j)*c%table(n + 1:, j)
    end do
    call take(s, g, c, v, g%gap, c%now)
    c%known = .true.
  end subroutine look

  !> Finds the first and the last free block. Blocks outside this range are held.
  pure subroutine find_ends(c)
    type(contact_t), intent(inout) :: c

    c%ends = [findloc(c%free, .true., dim=1), findloc(c%free, .true., dim=1, back=.true.)]
    if (c%ends(1) == 0) c%ends(1) = 1
  end subroutine find_ends

  !> Derivatives of the static state by the path length of the driver.
  pure subroutine rates(s, g, c, rate)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    type(contact_t), intent(in) :: c
    type(values_t), intent(inout) :: rate
    real(dp) :: no_gap(s%nx)

    no_gap = 0.0_dp
    call take(s, g, c, c%way*c%table(:, s%nx + 1), no_gap, rate)
  end subroutine rates

  pure subroutine take(s, g, c, v, gap, values)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    type(contact_t), intent(in) :: c
    real(dp), intent(in) :: v(3*s%nx + 1)        !! column of the table
    real(dp), intent(in) :: gap(s%nx)            !! heights of the blocks at u_z = 0 [m]
    type(values_t), intent(inout) :: values
    integer :: nx

    nx = s%nx
    values%u_x = v(:nx)
    values%u_z = v(2*nx + 1:3*nx)
    values%p = merge(-g%k_f*(values%u_z + gap), 0.0_dp, c%mode /= OPEN_GAP)
    values%f = merge(-way_of(c%mode)*(g%slide*values%p), v(nx + 1:2*nx), c%free)
    values%f_t = v(3*nx + 1)
  end subroutine take

  ! --- changes -------------------------------------------------------------------------------------

  !> Changes the contact states of blocks. Blocks that stick are held at u_x.
  pure subroutine put(s, g, c, which, mode, u_x)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    logical, intent(in) :: which(s%nx)           !! blocks that change
    integer(ip), intent(in) :: mode(s%nx)        !! new states of these blocks
    real(dp), intent(in) :: u_x(s%nx)            !! displacements at which blocks are held [m]
    integer(ip) :: new(s%nx)
    integer :: i, turn

    new = merge(possible(g%touches, g%rubs, mode), c%mode, which)
    if (any(which .and. (c%mode == OPEN_GAP .or. new == OPEN_GAP))) then
      call look(s, g, c)
      c%column(:s%nx) = merge(u_x, c%now%u_x, which)
      c%mode = new
      call renew(s, g, c)
      return
    end if
    do turn = 1, 2  ! blocks that stick come first, because they hold the slider
      do i = 1, s%nx
        if (which(i) .and. (new(i) == STUCK .eqv. turn == 1) .and. (c%free(i) .eqv. new(i) == STUCK)) then
          call exchange(s, g, c, i, new(i), u_x(i))
        end if
      end do
    end do
  end subroutine put

  !> Changes the contact state of block i at the present position of the block.
  pure subroutine change(s, g, c, i, mode)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    integer, intent(in) :: i
    integer(ip), intent(in) :: mode
    logical :: which(s%nx)
    integer(ip) :: new(s%nx)

    which = .false.
    which(i) = .true.
    new = mode
    call look(s, g, c)
    call put(s, g, c, which, new, c%now%u_x)
  end subroutine change

  !> Releases the stuck block i, or holds block i at u_x, by a pivot that exchanges column and row of the block.
  pure subroutine exchange(s, g, c, i, mode, u_x)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    integer, intent(in) :: i
    integer(ip), intent(in) :: mode
    real(dp), intent(in) :: u_x                  !! displacement at which the block is held [m]
    real(dp) :: row(s%nx + 2), factor(3*s%nx + 1), pivot, friction
    integer :: first, last, j

    if (mode == STUCK) then
      row = c%table(i, :)
    else
      friction = mode*(g%slide(i)*g%k_f(i))
      row = c%table(s%nx + i, :) - friction*c%table(2*s%nx + i, :)
      row(s%nx + 2) = row(s%nx + 2) - friction*g%gap(i)
    end if
    pivot = row(i)
    row = row/(-pivot)
    row(i) = 1.0_dp/pivot
    factor = c%table(:, i)
    c%table(:, i) = 0.0_dp
    first = min(c%ends(1), i)
    last = max(c%ends(2), i)
    do j = 1, s%nx + 2  ! u_x of held blocks does not change
      c%table(first:last, j) = c%table(first:last, j) + factor(first:last)*row(j)
      c%table(s%nx + 1:, j) = c%table(s%nx + 1:, j) + factor(s%nx + 1:)*row(j)
    end do
    if (mode == STUCK) c%table(i, :) = 0.0_dp
    if (mode == STUCK) c%table(i, i) = 1.0_dp
    c%column(i) = merge(u_x, 0.0_dp, mode == STUCK)
    c%free(i) = mode /= STUCK
    c%mode(i) = mode
    c%known = .false.
    call find_ends(c)
  end subroutine exchange

  !> Holds all slipping blocks, except those with negligible p, at their present positions, and computes the table anew.
  pure subroutine hold_all(s, g, c)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    integer(ip) :: held(s%nx)

    call look(s, g, c)
    c%column(:s%nx) = c%now%u_x
    held = STUCK
    c%mode = merge(possible(g%touches, g%rubs, held), c%mode, c%mode /= OPEN_GAP .and. c%now%p > s%least)
    call renew(s, g, c)
  end subroutine hold_all

  ! --- the table anew ------------------------------------------------------------------------------

  !> Computes the table anew: with all blocks held, then with all blocks free that are not stuck.
  pure subroutine renew(s, g, c)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    real(dp) :: largest
    integer :: n

    n = s%nx
    largest = max(s%k*maxval(abs(c%column(:n))), min(s%k, s%k_driver)*abs(c%column(n + 1)))
    c%tol = s%rounded*s%unit + 16*2.0_dp**(-52)*largest
    c%known = .false.
    if (c%tol > s%lost) c%status = UNHELD
    if (c%status /= DONE) return
    call find_base(s, g, c)
    if (c%status /= DONE) return
    c%table = c%bases(:, :, c%base)
    c%free = c%mode /= STUCK
    call find_ends(c)
    if (any(c%free)) call set_free(s, g, count(c%free), c)
  end subroutine renew

  !> Frees n blocks at once in a table with all blocks held.
  pure subroutine set_free(s, g, n, c)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    integer, intent(in) :: n
    type(contact_t), intent(inout) :: c
    integer :: at(n), pivot(n), i, j
    real(dp) :: friction(n)

    at = members(n, c%free)
    friction = way_of(c%mode(at))*(g%slide(at)*g%k_f(at))
    associate (rows => c%sides(:n, :, 1), factor => c%sides(:, :n, 2))
      do j = 1, s%nx + 2
        rows(:, j) = c%table(s%nx + at, j) - friction*c%table(2*s%nx + at, j)
      end do
      rows(:, s%nx + 2) = rows(:, s%nx + 2) - friction*g%gap(at)
      call invert_rows(n, s%nx + 2, at, size(c%sides, 1), c%sides(:, :, 1), c%squares(:, :, 1), pivot, c%status)
      if (c%status /= DONE) return
      factor = c%table(:, at)
      c%table(:, at) = 0.0_dp
      do j = 1, s%nx + 2
        do i = 1, n
          c%table(:, j) = c%table(:, j) - rows(i, j)*factor(:, i)
        end do
      end do
    end associate
    c%column(at) = 0.0_dp
  end subroutine set_free

  !> With A = rows(:, at), rows becomes A^-1 rows; the columns `at` become -A^-1.
  pure subroutine invert_rows(n, m, at, n_side, rows, a, pivot, status)
    integer, intent(in) :: n                     !! rows
    integer, intent(in) :: m                     !! columns
    integer, intent(in) :: at(n)
    integer, intent(in) :: n_side                !! room for rows
    real(dp), intent(inout) :: rows(n_side, m)
    real(dp), intent(inout) :: a(n, n)           !! work space
    integer, intent(out) :: pivot(n)
    integer(ip), intent(inout) :: status         !! UNHELD if there is no inverse
    integer :: i, j

    a = rows(:n, at)
    call decompose(n, a, pivot)
    do i = 1, n
      if (.not. abs(a(i, i)) > 0.0_dp) status = UNHELD
      rows(:n, at(i)) = 0.0_dp
      rows(i, at(i)) = -1.0_dp
    end do
    if (status /= DONE) return
    do j = 1, m
      call solve(n, a, pivot, rows(:n, j))
    end do
  end subroutine invert_rows

  !> Selects the stored table with all blocks held for the present set of blocks in contact. If it is missing, computes it in place
  !> of the table that is not in use.
  pure subroutine find_base(s, g, c)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c
    integer(ip) :: closed(s%nx)
    integer :: n

    closed = merge(1_ip, 0_ip, c%mode /= OPEN_GAP)
    do n = 1, KEPT
      if (all(c%sets(:, n) == closed)) c%base = n
    end do
    if (all(c%sets(:, c%base) == closed)) return
    c%base = 1 + mod(c%base, KEPT)
    c%sets(:, c%base) = -1
    call make_base(s, g, closed == 1, c%route, c%squares(:, :, 1), c%sides(:, :, 1), c%bases(:, :, c%base), c%status)
    if (c%status == DONE) c%sets(:, c%base) = closed
  end subroutine find_base

  !> Computes the table with all blocks held.
  pure subroutine make_base(s, g, closed, route, a, u_z, table, status)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    logical, intent(in) :: closed(s%nx)
    integer, intent(in) :: route
    real(dp), intent(inout) :: a(s%nx, s%nx)     !! work space
    real(dp), intent(inout) :: u_z(s%nx + 2, s%nx)  !! work space
    real(dp), intent(out) :: table(3*s%nx + 1, s%nx + 2)
    integer(ip), intent(inout) :: status         !! UNSUPPORTED if the slider is not supported
    real(dp) :: k_f(s%nx)
    integer :: i, j, n
    logical :: positive

    n = s%nx
    k_f = merge(g%k_f, 0.0_dp, closed)
    a = s%s(n + 1:, n + 1:)
    do i = 1, n
      a(i, i) = a(i, i) + k_f(i)
      u_z(:n, i) = -s%s(n + i, :n)
      u_z(n + 1:, i) = s%loads(n + i, :, route) - [0.0_dp, k_f(i)*g%gap(i)]
    end do
    call cholesky(n, a, positive)
    if (.not. positive) status = UNSUPPORTED
    if (.not. positive) return
    call solve_rows(n, a, n + 2, u_z)
    table = 0.0_dp
    do j = 1, n
      table(j, j) = 1.0_dp
      table(n + 1:2*n, j) = s%s(:n, j)
      table(3*n + 1, j) = -s%drive(j)
    end do
    table(n + 1:2*n, n + 1:) = -s%loads(:n, :, route)
    table(3*n + 1, n + 1:) = s%f_t(:, route)
    do j = 1, n + 2
      table(2*n + 1:3*n, j) = u_z(j, :)
      do i = 1, n
        table(n + 1:2*n, j) = table(n + 1:2*n, j) + u_z(j, i)*s%s(:n, n + i)
        table(3*n + 1, j) = table(3*n + 1, j) - s%drive(n + i)*u_z(j, i)
      end do
    end do
  end subroutine make_base

  ! --- uniqueness ----------------------------------------------------------------------------------

  !> Whether the definiteness of the slip operator W is at least `least` (pyfric.statics.contact). This holds if
  !> (W + W')/2 - least F is positive definite, with F the operator without friction. Open blocks move freely.
  pure subroutine test_definite(s, g, c, least, definite)
    type(slider_t), intent(in) :: s
    type(ground_t), intent(in) :: g
    type(contact_t), intent(inout) :: c          !! only the work space changes
    real(dp), intent(in) :: least
    logical, intent(out) :: definite
    integer :: n_open, n_slip

    n_open = count(c%mode == OPEN_GAP)
    n_slip = count(abs(c%mode) == 1)
    call slip_operator(s%nx, n_open, n_slip, members(n_open, c%mode == OPEN_GAP), members(n_slip, abs(c%mode) == 1), &
                       way_of(c%mode)*(g%slide*g%k_f), least, c%bases(:, :, c%base), c%squares(:, :, 1), c%squares(:, :, 2), &
                       c%squares(:, :, 3), c%squares(:, :, 4), definite)
    if (definite) call cholesky(n_slip, c%squares(:, :, 3), definite)
  end subroutine test_definite

  !> (W + W')/2 - least F of n_slip blocks, while n_open blocks move freely.
  pure subroutine slip_operator(nx, n_open, n_slip, open_, slip, friction, least, base, f_open, follow, w, f, supported)
    integer, intent(in) :: nx
    integer, intent(in) :: n_open
    integer, intent(in) :: n_slip
    integer, intent(in) :: open_(n_open)
    integer, intent(in) :: slip(n_slip)
    real(dp), intent(in) :: friction(nx)                    !! sigma slide k_f [N/m]
    real(dp), intent(in) :: least
    real(dp), intent(in) :: base(3*nx + 1, nx + 2)          !! table with all blocks held
    real(dp), intent(inout) :: f_open(n_open, n_open)       !! work space
    real(dp), intent(inout) :: follow(n_slip, n_open)       !! work space: response of open blocks to slipping blocks
    real(dp), intent(inout) :: w(n_slip, n_slip)            !! the result [N/m]
    real(dp), intent(inout) :: f(n_slip, n_slip)            !! work space
    logical, intent(out) :: supported
    integer :: i, j

    f_open = base(nx + open_, open_)
    follow = base(nx + slip, open_)  ! F is symmetric
    call cholesky(n_open, f_open, supported)
    if (.not. supported) return
    call solve_rows(n_open, f_open, n_slip, follow)
    do j = 1, n_slip
      f(:, j) = base(nx + slip, slip(j))
      w(:, j) = f(:, j) - friction(slip)*base(2*nx + slip, slip(j))
      do i = 1, n_open
        f(:, j) = f(:, j) - follow(j, i)*base(nx + slip, open_(i))
        w(:, j) = w(:, j) - follow(j, i)*(base(nx + slip, open_(i)) - friction(slip)*base(2*nx + slip, open_(i)))
      end do
    end do
    f = w - least*f
    do j = 1, n_slip
      do i = 1, n_slip
        w(i, j) = 0.5_dp*(f(i, j) + f(j, i))
      end do
    end do
  end subroutine slip_operator
end module pyfric_pivots
