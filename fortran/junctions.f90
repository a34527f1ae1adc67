!> A friction law with memory: junctions that break, slip for a while, and pin again.
!>
!> Each block has n_s junctions. Junction j has an anchor a_j, a stretch d_j = u_x - a_j, and bears -k_j d_j. All junctions
!> of a block bear the same share p/n_s of its normal force:
!>
!>     k_j = sqrt(C p/n_s),   break at |d_j| > c_j u_s,  u_s = mu_s k_j/C,   slip level u_d = mu_d k_j/C
!>
!>     pinned     the anchor rests
!>     slipping   the anchor is dragged so that |d_j| <= u_d; a time t_R after the break the junction pins at u_x, without force
!>     open       p = 0: all junctions slip, and pin at u_x when contact returns
!>
!> Stages of a step drag anchors of slipping junctions only temporarily. Anchors are stored at the end of a step or sub-step.
!> Source: J. Trømborg et al., PNAS 111, 8764 (2014). Two rules are not from this source: k_j follows the present p, and slipping
!> junctions keep their anchors when motion reverses, until |d_j| = u_d.
module pyfric_junctions
  use, intrinsic :: iso_fortran_env, only: int64
  use pyfric_kinds, only: dp, ip
  use pyfric_layout, only: LB, LANES
  use pyfric_curve, only: curve_t, at_x
  use pyfric_junction_memory, only: ANCHOR, PINNED, RELEASE, BREAKS, N_PARTS, N_SUMS, COUNT, TOTAL, CENTRE, SQUARES, LEAST, &
                                    GREATEST, EARLIEST, LOOSE, n_saved, n_whole, prepare
  use pyfric_random, only: uniforms
  implicit none (type, external)
  private
  public :: junctions_t, new_junctions
  public :: forces, powers, stored_energy, settle, break_functions, next_release, drag_marks, drag_functions, N_FIELDS

  integer, parameter :: N_FIELDS = 5   !! number of fields of N_x numbers

  !> Difference of a stretch from u_d, over u_d, that counts as rounding of displacements.
  real(dp), parameter :: AT_LIMIT = 1e-9_dp

  type :: junctions_t
    logical :: complete = .false.   !! whether memory was allocated
    integer :: n = 0                       !! number of junctions of a block
    real(dp) :: fewest                     !! number of pinned junctions below which a block is ruptured
    integer(int64) :: seed                 !! seed of the slip times of junctions
    logical :: from_right                  !! whether blocks are counted from the right side, because it is driven
    type(curve_t) :: quantiles             !! quantiles of t_R over the mean of t_R; no knots: a normal distribution
    real(dp), allocatable :: factors(:)    !! c_j of each junction of a block
    real(dp), allocatable :: mu_s(:)       !! friction coefficient at which a junction breaks [-]
    real(dp), allocatable :: mu_d(:)       !! friction coefficient of a slipping junction [-]
    real(dp), allocatable :: c(:)          !! C [N/m2]
    real(dp), allocatable :: t_r(:)        !! mean of t_R [s]
    real(dp), allocatable :: t_r_std(:)    !! standard deviation of t_R; 0: every t_R is the mean [s]
  end type junctions_t

  !> Numbers passed by Python, in this order.
  type :: numbers_t
    real(dp) :: n           !! number of junctions of a block
    real(dp) :: seed_low    !! lower 32 bits of the seed
    real(dp) :: seed_high   !! upper 32 bits of the seed
    real(dp) :: ruptured    !! share of pinned junctions below which a block is ruptured
  end type numbers_t

contains

  pure function new_junctions(nx, numbers, from_right, quantiles, strengths, fields) result(of)
    integer, intent(in) :: nx              !! blocks
    real(dp), contiguous, intent(in) :: numbers(:)     !! see numbers_t
    logical, intent(in) :: from_right
    type(curve_t), intent(in) :: quantiles
    type(curve_t), intent(in) :: strengths !! c_j over the number of the junction; no knots: all c_j are 1
    real(dp), intent(in) :: fields(nx, N_FIELDS)  !! mu_s, mu_d, C, mean and standard deviation of t_R
    type(junctions_t) :: of
    type(numbers_t) :: given
    integer :: failed, n

    given = transfer(numbers, given)
    n = nint(given%n)
    of%n = n
    of%fewest = given%ruptured*n
    of%seed = ior(int(given%seed_low, int64), shiftl(int(given%seed_high, int64), 32))
    of%from_right = from_right
    of%quantiles = quantiles
    allocate (of%mu_s(nx), of%mu_d(nx), of%c(nx), of%t_r(nx), of%t_r_std(nx), of%factors(n), stat=failed)
    of%complete = failed == 0 .and. quantiles%complete
    if (.not. of%complete) return
    of%mu_s(:) = fields(:, 1)
    of%mu_d(:) = fields(:, 2)
    of%c(:) = fields(:, 3)
    of%t_r(:) = fields(:, 4)
    of%t_r_std(:) = fields(:, 5)
    of%factors(:) = 1.0_dp
    if (strengths%n == n) of%factors(:) = strengths%y(:n)
  end function new_junctions

  !> Stiffness k_j of a junction [N/m].
  pure elemental function stiffness(of, i, p) result(k)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: i        !! block
    real(dp), intent(in) :: p       !! normal force of the block [N]
    real(dp) :: k

    k = sqrt(of%c(i)*p/of%n)
  end function stiffness

  !> x, limited to -limit ... limit. A change of sign of x changes only the sign of the result.
  pure elemental function within(limit, x) result(y)
    real(dp), intent(in) :: limit
    real(dp), intent(in) :: x
    real(dp) :: y

    y = max(-limit, min(limit, x))
  end function within

  !> Forces on the blocks, -k_j (sum of stretches). The stretches of n pinned junctions have the sum n u_x - sum a_j. The stretch of
  !> a slipping junction is at most u_d.
  pure subroutine forces(of, nx, n, at, memory, u_x, p, f)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    real(dp), intent(in) :: memory(n_whole(of%n), nx)
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(out) :: f(nx)               !! force on the blocks, along +x [N]
    real(dp) :: k, u, stretch
    integer :: i, s, m

    s = n_saved(of%n)
    do i = 1, nx
      u = u_x(at(i))
      k = stiffness(of, i, p(i))
      stretch = memory(s + COUNT, i)*u - memory(s + TOTAL, i)
      m = int(memory(s + LOOSE, i))
      if (m > 0) stretch = stretch + slipping_stretch(m, u, of%mu_d(i)*k/of%c(i), memory(s + N_SUMS + 1, i))
      f(i) = -k*stretch
    end do
  end subroutine forces

  !> Sum of the stretches of m slipping junctions, with one partial sum for each lane of a vector.
  pure function slipping_stretch(m, u, u_d, anchors) result(total)
    integer, intent(in) :: m
    real(dp), intent(in) :: u           !! displacement of the block [m]
    real(dp), intent(in) :: u_d         !! slip level [m]
    real(dp), intent(in) :: anchors(m)  !! anchors of slipping junctions [m]
    real(dp) :: total, lanes_of(LANES)
    integer :: j, l, whole

    lanes_of = 0.0_dp
    whole = m - mod(m, LANES)
    do j = 0, whole - 1, LANES
      do l = 1, LANES
        lanes_of(l) = lanes_of(l) + within(u_d, u - anchors(j + l))
      end do
    end do
    do l = 1, m - whole
      lanes_of(l) = lanes_of(l) + within(u_d, u - anchors(whole + l))
    end do
    total = (lanes_of(1) + lanes_of(2)) + (lanes_of(3) + lanes_of(4))
  end function slipping_stretch

  !> Power of dragging, the sum of k_j u_d (+-v_x - du_d/dt) over moving anchors, and power of changes of stiffness, the sum of
  !> dk_j/dt d_j^2/2 over junctions.
  pure subroutine powers(of, nx, n, at, memory, u_x, v_x, p, p_rate, dragging, stiffening)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    real(dp), intent(in) :: memory(n_whole(of%n), nx)
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: p_rate(nx)           !! rate of p [N/s]
    real(dp), intent(out) :: dragging(nx)        !! power of dragging [W]
    real(dp), intent(out) :: stiffening(nx)      !! power of changes of stiffness [W]
    real(dp) :: k, u_d, growth, d, heat
    integer :: i, j, s

    dragging = 0.0_dp
    stiffening = 0.0_dp
    s = n_saved(of%n)
    do i = 1, nx
      if (p(i) <= 0.0_dp) cycle
      k = stiffness(of, i, p(i))
      u_d = of%mu_d(i)*k/of%c(i)
      growth = p_rate(i)/(2.0_dp*p(i))   ! relative rate of k_j and of u_d [1/s]
      heat = 0.0_dp
      do j = 1, int(memory(s + LOOSE, i))
        d = u_x(at(i)) - memory(s + N_SUMS + j, i)
        heat = heat + anchor_speed(d, u_d, v_x(at(i)), growth*u_d)
      end do
      dragging(i) = k*u_d*heat
      stiffening(i) = 0.5_dp*growth*k*squares_of(of%n, u_x(at(i)), u_d, memory(:, i))
    end do
  end subroutine powers

  !> Speed at which an anchor is dragged along the stretch. It is dragged if the stretch exceeds u_d, or is u_d and would grow.
  pure elemental function anchor_speed(d, u_d, v, u_d_rate) result(speed)
    real(dp), intent(in) :: d           !! stretch, with the anchor at the start of the step [m]
    real(dp), intent(in) :: u_d         !! slip level [m]
    real(dp), intent(in) :: v           !! velocity of the block [m/s]
    real(dp), intent(in) :: u_d_rate    !! rate of u_d [m/s]
    real(dp) :: speed

    speed = 0.0_dp
    if (abs(d) < u_d*(1.0_dp - AT_LIMIT)) return
    speed = sign(1.0_dp, d)*v - u_d_rate
    if (abs(d) <= u_d*(1.0_dp + AT_LIMIT)) speed = max(speed, 0.0_dp)
  end function anchor_speed

  !> Sum of the squares of all stretches of a block [m2].
  pure function squares_of(n, u, u_d, memory) result(total)
    integer, intent(in) :: n
    real(dp), intent(in) :: u           !! displacement of the block [m]
    real(dp), intent(in) :: u_d         !! slip level [m]
    real(dp), intent(in) :: memory(n_whole(n))
    real(dp) :: total
    integer :: j, s

    s = n_saved(n)
    total = memory(s + SQUARES) + memory(s + COUNT)*(u - memory(s + CENTRE))**2
    do j = 1, int(memory(s + LOOSE))
      total = total + within(u_d, u - memory(s + N_SUMS + j))**2
    end do
  end function squares_of

  !> Sum of k_j d_j^2/2 over all junctions of all blocks [J].
  pure function stored_energy(of, nx, memory, u_x, p) result(energy)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: nx                !! blocks
    real(dp), intent(in) :: memory(n_whole(of%n), nx)
    real(dp), intent(in) :: u_x(nx)          !! displacements, left to right [m]
    real(dp), intent(in) :: p(nx)            !! foundation force [N]
    real(dp) :: energy, k
    integer :: i

    energy = 0.0_dp
    do i = 1, nx
      k = stiffness(of, i, p(i))
      energy = energy + 0.5_dp*k*squares_of(of%n, u_x(i), of%mu_d(i)*k/of%c(i), memory(:, i))
    end do
  end function stored_energy

  !> Finishes a step or sub-step: anchors of slipping junctions follow their block, junctions break, and junctions pin. `excess` is
  !> the number of pinned junctions minus the number below which a block is ruptured.
  pure subroutine settle(of, nx, n, at, t, soon, u_x, p, memory, excess, loss)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    real(dp), intent(in) :: t                    !! time [s]
    real(dp), intent(in) :: soon                 !! time ahead within which junctions pin now [s]
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(inout) :: memory(n_whole(of%n), nx)
    real(dp), intent(out) :: excess(nx)          !! number of breaks before a block is ruptured [-]
    real(dp), intent(inout) :: loss(nx)          !! heat of breaks and of pinning so far [J]
    real(dp) :: k, u, stretch, weakest
    logical :: changed
    integer :: i, s

    s = n_saved(of%n)
    weakest = minval(of%factors)
    do i = 1, nx
      u = u_x(at(i))
      k = stiffness(of, i, p(i))
      changed = .false.
      if (memory(s + LOOSE, i) > 0.0_dp) call drag(of%n, u, of%mu_d(i)*k/of%c(i), memory(1, i))
      if (p(i) > 0.0_dp) then
        stretch = max(u - memory(s + LEAST, i), memory(s + GREATEST, i) - u)
        if (stretch > weakest*(of%mu_s(i)*k/of%c(i))) call break_stretched(of, i, t, u, k, memory(1, i), loss(i), changed)
        if (changed .or. memory(s + EARLIEST, i) <= t + soon) call pin_due(of%n, t + soon, u, k, memory(1, i), loss(i), changed)
      else if (memory(s + COUNT, i) > 0.0_dp) then
        call let_go(of%n, t, u, memory(1, i))
        changed = .true.
      end if
      if (changed) call prepare(of%n, memory(1, i))
      excess(i) = memory(s + COUNT, i) - of%fewest
    end do
  end subroutine settle

  !> Moves anchors of slipping junctions so that they are at most u_d behind the block.
  pure subroutine drag(n, u, u_d, memory)
    integer, intent(in) :: n
    real(dp), intent(in) :: u           !! displacement of the block [m]
    real(dp), intent(in) :: u_d         !! slip level [m]
    real(dp), intent(inout) :: memory(n_whole(n))
    integer :: c, first, last

    first = n_saved(n) + N_SUMS + 1
    last = first - 1 + int(memory(n_saved(n) + LOOSE))
    do c = first, last
      memory(c) = u - within(u_d, u - memory(c))
    end do
    do c = first, last
      memory(int(memory(c + n))) = memory(c)
    end do
  end subroutine drag

  !> Breaks pinned junctions with |d_j| > c_j u_s. Their stretch drops to u_d at most, and they slip for a time t_R.
  pure subroutine break_stretched(of, i, t, u, k, memory, loss, changed)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: i            !! block
    real(dp), intent(in) :: t           !! time [s]
    real(dp), intent(in) :: u           !! displacement of the block [m]
    real(dp), intent(in) :: k           !! k_j [N/m]
    real(dp), intent(inout) :: memory(of%n, N_PARTS)
    real(dp), intent(inout) :: loss     !! heat of breaks and of pinning so far [J]
    logical, intent(inout) :: changed
    real(dp) :: u_s, d, after
    integer :: j

    u_s = of%mu_s(i)*k/of%c(i)
    do j = 1, of%n
      d = u - memory(j, ANCHOR)
      if (memory(j, PINNED) <= 0.0_dp .or. abs(d) <= of%factors(j)*u_s) cycle
      after = within(of%mu_d(i)*k/of%c(i), d)
      memory(j, ANCHOR) = u - after
      memory(j, PINNED) = 0.0_dp
      memory(j, BREAKS) = memory(j, BREAKS) + 1.0_dp
      memory(j, RELEASE) = t + time_of_slip(of, i, j, int(memory(j, BREAKS), int64))
      loss = loss + 0.5_dp*k*(d**2 - after**2)
      changed = .true.
    end do
  end subroutine break_stretched

  !> Pins slipping junctions at u_x, without force, at the end of their slip time.
  pure subroutine pin_due(n, t, u, k, memory, loss, changed)
    integer, intent(in) :: n
    real(dp), intent(in) :: t           !! time [s]
    real(dp), intent(in) :: u           !! displacement of the block [m]
    real(dp), intent(in) :: k           !! k_j [N/m]
    real(dp), intent(inout) :: memory(n, N_PARTS)
    real(dp), intent(inout) :: loss     !! heat of breaks and of pinning so far [J]
    logical, intent(inout) :: changed
    integer :: j

    do j = 1, n
      if (memory(j, PINNED) > 0.0_dp .or. memory(j, RELEASE) > t) cycle
      loss = loss + 0.5_dp*k*(u - memory(j, ANCHOR))**2
      memory(j, ANCHOR) = u
      memory(j, PINNED) = 1.0_dp
      changed = .true.
    end do
  end subroutine pin_due

  !> Opens a block: all junctions slip, and pin as soon as contact returns.
  pure subroutine let_go(n, t, u, memory)
    integer, intent(in) :: n
    real(dp), intent(in) :: t           !! time [s]
    real(dp), intent(in) :: u           !! displacement of the block [m]
    real(dp), intent(inout) :: memory(n, N_PARTS)

    memory(:, ANCHOR) = u
    memory(:, PINNED) = 0.0_dp
    memory(:, RELEASE) = t
  end subroutine let_go

  !> Slip time of junction j of block i after its break number n: mean + std (sum of 12 uniform numbers - 6), at least 0, or the
  !> mean times the quantile of a uniform number. i, j and n are the counter of the random numbers. i counts from the driven side.
  pure function time_of_slip(of, i, j, n) result(t_r)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: i
    integer, intent(in) :: j
    integer(int64), intent(in) :: n
    real(dp) :: t_r, u(12), total
    integer(int64) :: counter(4)
    integer :: a

    t_r = of%t_r(i)
    if (of%t_r_std(i) <= 0.0_dp) return
    counter = [0_int64, int(merge(size(of%c) + 1 - i, i, of%from_right), int64), int(j, int64), n]
    u = uniforms([of%seed, 0_int64], counter, 12)
    if (of%quantiles%n > 0) then
      t_r = t_r*at_x(of%quantiles, u(1))
      return
    end if
    total = 0.0_dp
    do a = 1, 12
      total = total + u(a)
    end do
    t_r = max(t_r + of%t_r_std(i)*(total - 6.0_dp), 0.0_dp)
  end function time_of_slip

  !> Distance that a block can move before a junction breaks [m]; huge if no junction is pinned.
  pure function next_break(of, i, u, p, memory) result(room)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: i            !! block
    real(dp), intent(in) :: u           !! displacement of the block [m]
    real(dp), intent(in) :: p           !! normal force of the block [N]
    real(dp), intent(in) :: memory(of%n, N_PARTS)
    real(dp) :: room, u_s
    integer :: j

    u_s = of%mu_s(i)*stiffness(of, i, p)/of%c(i)
    room = huge(room)
    do j = 1, of%n
      if (memory(j, PINNED) > 0.0_dp) room = min(room, of%factors(j)*u_s - abs(u - memory(j, ANCHOR)))
    end do
  end function next_break

  !> Time at which the next junction of any block in contact pins [s]; huge if no junction slips.
  pure function next_release(of, nx, in_contact, memory) result(t)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: nx               !! blocks
    logical, intent(in) :: in_contact(nx)
    real(dp), intent(in) :: memory(n_whole(of%n), nx)
    real(dp) :: t

    t = minval(memory(n_saved(of%n) + EARLIEST, :), mask=in_contact)
  end function next_release

  !> Event functions [m]. In contact: distance of the block to its next break, and depth of the block. Open: the height, twice.
  pure subroutine break_functions(of, nx, n, at, in_contact, memory, p, u_x, z, g)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    logical, intent(in) :: in_contact(nx)
    real(dp), intent(in) :: memory(n_whole(of%n), nx)
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: z(nx)                !! heights above the foundation [m]
    real(dp), intent(out) :: g(2, nx)
    integer :: i

    do i = 1, nx
      g(:, i) = z(i)
      if (in_contact(i)) g(:, i) = [next_break(of, i, u_x(at(i)), p(i), memory(1, i)), -z(i)]
    end do
  end subroutine break_functions

  !> `drag_limits` of each block, as marks at the start of a sub-step.
  pure subroutine drag_marks(of, nx, n, at, memory, u_x, v_x, p, p_rate, marks)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    real(dp), intent(in) :: memory(n_whole(of%n), nx)
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: p_rate(nx)           !! rate of p [N/s]
    real(dp), intent(out) :: marks(4, nx)
    integer :: i

    do i = 1, nx
      marks(:, i) = drag_limits(of, i, u_x(at(i)), v_x(at(i)), p(i), p_rate(i), memory(1, i))
    end do
  end subroutine drag_marks

  !> Whether slipping junctions of a block are dragged up, and down (1 or 0); smallest and largest anchor of all slipping junctions
  !> that are not dragged [m].
  pure function drag_limits(of, i, u, v, p, p_rate, memory) result(marks)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: i            !! block
    real(dp), intent(in) :: u           !! displacement of the block [m]
    real(dp), intent(in) :: v           !! velocity of the block [m/s]
    real(dp), intent(in) :: p           !! normal force of the block [N]
    real(dp), intent(in) :: p_rate      !! rate of p [N/s]
    real(dp), intent(in) :: memory(n_whole(of%n))
    real(dp) :: marks(4), u_d, a
    integer :: j, s

    marks = [0.0_dp, 0.0_dp, huge(1.0_dp), -huge(1.0_dp)]
    if (p <= 0.0_dp) return
    s = n_saved(of%n)
    u_d = of%mu_d(i)*stiffness(of, i, p)/of%c(i)
    do j = 1, int(memory(s + LOOSE))
      a = memory(s + N_SUMS + j)
      if (anchor_speed(u - a, u_d, v, u_d*(p_rate/(2.0_dp*p))) > 0.0_dp) then
        marks(merge(1, 2, u > a)) = 1.0_dp
      else
        marks(3) = min(marks(3), a)
        marks(4) = max(marks(4), a)
      end if
    end do
  end function drag_limits

  !> Event functions, which are positive while the set of dragged junctions does not change: speeds of dragged anchors, up and
  !> down, and distances of the other stretches from u_d.
  pure subroutine drag_functions(of, nx, n, at, u_x, v_x, p, p_rate, marks, g)
    type(junctions_t), intent(in) :: of
    integer, intent(in) :: nx                    !! blocks
    integer, intent(in) :: n                     !! padded length of a row
    integer, intent(in) :: at(n)                 !! element of each block in a row
    real(dp), intent(in) :: u_x(LB:n + LANES)    !! displacements, as a row [m]
    real(dp), intent(in) :: v_x(LB:n + LANES)    !! velocities, as a row [m/s]
    real(dp), intent(in) :: p(nx)                !! foundation force [N]
    real(dp), intent(in) :: p_rate(nx)           !! rate of p [N/s]
    real(dp), intent(in) :: marks(4, nx)         !! see drag_limits
    real(dp), intent(out) :: g(3, nx)
    real(dp) :: u_d, u_d_rate
    integer :: i

    g = 1.0_dp
    do i = 1, nx
      if (p(i) <= 0.0_dp) cycle
      u_d = of%mu_d(i)*stiffness(of, i, p(i))/of%c(i)
      u_d_rate = u_d*(p_rate(i)/(2.0_dp*p(i)))
      if (marks(1, i) > 0.0_dp) g(1, i) = v_x(at(i)) - u_d_rate
      if (marks(2, i) > 0.0_dp) g(2, i) = -v_x(at(i)) - u_d_rate
      if (marks(4, i) >= marks(3, i)) g(3, i) = min(marks(3, i) + u_d - u_x(at(i)), u_x(at(i)) - marks(4, i) + u_d)
    end do
  end subroutine drag_functions
end module pyfric_junctions
