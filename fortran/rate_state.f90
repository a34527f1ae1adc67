!> Rate-and-state friction: no block rests, and friction depends on the speed v and on one state variable theta.
!>
!>     f = -sign(v) p a asinh( |v|/(2 V*) exp((f* + b psi)/a) ) - alpha v,   psi = ln(V* theta/D_c + V*/V_c)
!>     ageing  dtheta/dt = 1 - |v| theta/D_c          slip  dtheta/dt = -(|v| theta/D_c) ln(|v| theta/D_c)
!>
!> V*/V_c = 0 without a cut-off speed V_c. At given v both laws are linear, dx/dt = source - |v|/D_c x, in x = theta (ageing)
!> or x = ln(V* theta/D_c) (slip). So an implicit stage knows x for each v, and v is the root of one equation. A block counts
!> as slipping while |v| >= v_slip. All procedures work on `TOGETHER` blocks at once, so that vectors speed them up and work
!> arrays need no allocation.
!>
!> Sources: J. H. Dieterich, J. Geophys. Res. 84, 2161 (1979); A. L. Ruina, J. Geophys. Res. 88, 10359 (1983); the form with
!> asinh: J. R. Rice, N. Lapusta, K. Ranjith, J. Mech. Phys. Solids 49, 1865 (2001).
module pyfric_rate_state
  use pyfric_kinds, only: dp, ip
  use pyfric_elementary, only: exponentials, logarithms, logs_of_1_plus
  implicit none (type, external)
  private
  public :: rate_state_t, new_rate_state, rate_forces, implicit_speeds, variables_of, thetas_of, variable_rates
  public :: balanced_speeds, evolution_rates

  integer(ip), parameter :: AGEING = 1, SLIP_LAW = 2
  !> Newton steps of a root at most, the step in ln(v) after which the next one is the last, and the least ln(|v|/V*).
  integer, parameter :: MOST = 100
  real(dp), parameter :: LAST_STEP = 1e-7_dp, LEAST = -600.0_dp
  !> exp(-2 q) is lost beside 1 above this q.
  real(dp), parameter :: LOST = 20.0_dp
  !> 1 - exp(-2 y) is a polynomial of degree 3 below this y.
  real(dp), parameter :: SMALL = 1e-5_dp
  integer, parameter :: TOGETHER = 64

  type :: rate_state_t
    logical :: complete = .false.     !! there was enough memory
    integer(ip) :: evolution = 0      !! AGEING or SLIP_LAW
    real(dp) :: v_ref                 !! V* [m/s]
    real(dp) :: cut                   !! V*/V_c, 0 without a cut-off speed [-]
    real(dp) :: v_slip                !! speed from which a block slips [m/s]
    real(dp), allocatable :: a(:)     !! direct effect [-]
    real(dp), allocatable :: b(:)     !! evolution effect [-]
    real(dp), allocatable :: d_c(:)   !! D_c [m]
    real(dp), allocatable :: alpha(:) !! viscosity of slip [N s/m]
    real(dp), allocatable :: f_ref(:) !! f* [-]
  end type rate_state_t

contains

  pure function new_rate_state(nx, evolution, speeds, fields) result(of)
    integer, intent(in) :: nx               !! blocks
    integer(ip), intent(in) :: evolution    !! AGEING or SLIP_LAW
    real(dp), intent(in) :: speeds(3)       !! V* [m/s], V*/V_c, v_slip [m/s]
    real(dp), intent(in) :: fields(nx, 5)   !! a, b, D_c, alpha, f*
    type(rate_state_t) :: of
    integer :: failed

    of%evolution = evolution
    of%v_ref = speeds(1)
    of%cut = speeds(2)
    of%v_slip = speeds(3)
    allocate (of%a(nx), of%b(nx), of%d_c(nx), of%alpha(nx), of%f_ref(nx), stat=failed)
    of%complete = failed == 0
    if (.not. of%complete) return
    of%a(:) = fields(:, 1)
    of%b(:) = fields(:, 2)
    of%d_c(:) = fields(:, 3)
    of%alpha(:) = fields(:, 4)
    of%f_ref(:) = fields(:, 5)
  end function new_rate_state

  !> The variables x in which evolution is linear, from theta [s].
  pure subroutine variables_of(of, nx, theta, x)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: theta(nx)
    real(dp), intent(out) :: x(nx)

    if (of%evolution == AGEING) then
      x = theta
    else
      x = of%v_ref*theta/of%d_c
      call logarithms(nx, x)
    end if
  end subroutine variables_of

  !> theta [s] from the variables x.
  pure subroutine thetas_of(of, nx, x, theta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: x(nx)
    real(dp), intent(out) :: theta(nx)

    theta = x
    if (of%evolution == AGEING) return
    call exponentials(nx, theta)
    theta = of%d_c/of%v_ref*theta
  end subroutine thetas_of

  !> dx/dt.
  pure subroutine variable_rates(of, nx, v, x, rate)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: v(nx)      !! velocities [m/s]
    real(dp), intent(in) :: x(nx)
    real(dp), intent(out) :: rate(nx)

    if (of%evolution == AGEING) then
      rate = 1.0_dp - abs(v)/of%d_c*x
    else
      rate = max(abs(v)/of%v_ref, tiny(1.0_dp))
      call logarithms(nx, rate)
      rate = -abs(v)/of%d_c*(x + rate)
    end if
  end subroutine variable_rates

  !> psi from x, and its derivative by it, of blocks from number `from` on.
  pure subroutine state_effect(of, from, n, x, psi, slope)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: x(n)
    real(dp), intent(out) :: psi(n)
    real(dp), intent(out) :: slope(n)
    real(dp) :: ratio(TOGETHER)
    integer :: i

    if (of%evolution == AGEING) then
      do i = 1, n
        ratio(i) = of%v_ref*x(i)/of%d_c(from + i - 1) + of%cut
        psi(i) = max(ratio(i), tiny(1.0_dp))
        slope(i) = of%v_ref/of%d_c(from + i - 1)/ratio(i)
      end do
      call logarithms(n, psi)
    else if (of%cut > 0.0_dp) then
      ratio(:n) = x
      call exponentials(n, ratio)
      do i = 1, n
        psi(i) = ratio(i) + of%cut
        slope(i) = ratio(i)/psi(i)
      end do
      call logarithms(n, psi)
    else
      psi = x
      slope = 1.0_dp
    end if
  end subroutine state_effect

  !> asinh(exp(q)/2), and its derivative by q.
  pure subroutine asinh_of_exp(n, q, value, slope)
    integer, intent(in) :: n
    real(dp), intent(in) :: q(n)
    real(dp), intent(out) :: value(n)
    real(dp), intent(out) :: slope(n)
    real(dp) :: s, root
    integer :: i

    value = q
    slope = 1.0_dp
    if (all(q > LOST)) return
    do i = 1, n
      value(i) = merge(-2.0_dp*q(i), q(i), q(i) > 0.0_dp)
    end do
    call exponentials(n, value)
    do i = 1, n
      s = value(i)
      root = sqrt(1.0_dp + merge(4.0_dp*s, 0.25_dp*s*s, q(i) > 0.0_dp))
      slope(i) = merge(1.0_dp, 0.5_dp*s, q(i) > 0.0_dp)/root
      value(i) = merge(2.0_dp*s, 0.5_dp*s*(1.0_dp + root + 0.5_dp*s), q(i) > 0.0_dp)/(1.0_dp + root)
    end do
    call logs_of_1_plus(n, value)
    do i = 1, n
      value(i) = value(i) + max(q(i), 0.0_dp)
    end do
  end subroutine asinh_of_exp

  !> Friction force of each block along +x [N].
  pure subroutine rate_forces(of, nx, theta, v, p, f)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx              !! blocks
    real(dp), intent(in) :: theta(nx)      !! [s]
    real(dp), intent(in) :: v(nx)          !! velocities [m/s]
    real(dp), intent(in) :: p(nx)          !! foundation force [N]
    real(dp), intent(out) :: f(nx)         !! [N]
    real(dp), dimension(TOGETHER) :: eta, psi, slope, value
    integer :: from, n, i, k

    call variables_of(of, nx, theta, f)
    do from = 1, nx, TOGETHER
      n = min(TOGETHER, nx - from + 1)
      call state_effect(of, from, n, f(from), psi, slope)
      do i = 1, n
        eta(i) = max(abs(v(from + i - 1))/of%v_ref, tiny(1.0_dp))
      end do
      call logarithms(n, eta)
      do i = 1, n
        k = from + i - 1
        eta(i) = eta(i) + (of%f_ref(k) + of%b(k)*psi(i))/of%a(k)
      end do
      call asinh_of_exp(n, eta, value, slope)
      do i = 1, n
        k = from + i - 1
        f(k) = merge(-sign(of%a(k)*value(i)*p(k), v(k)) - of%alpha(k)*v(k), 0.0_dp, p(k) > 0.0_dp .and. abs(v(k)) > 0.0_dp)
      end do
    end do
  end subroutine rate_forces

  !> Velocities and variables x at the end of an implicit stage, which adds h f(v, x)/m and h dx/dt to their values before:
  !>
  !>     v + (h/m) (alpha v + p a asinh(...)) = v_0 ,   x = (x_0 + h source)/(1 + h |v|/D_c) .
  !>
  !> The left side grows with |v|, unless weakening is faster than the step. Newton's method in ln(|v|/V*), within bounds that
  !> it narrows; a block that has its root waits for the others.
  pure subroutine implicit_speeds(of, nx, h, m, p, x_0, near, v, x)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx            !! blocks
    real(dp), intent(in) :: h            !! step times the diagonal of the table [s]
    real(dp), intent(in) :: m(nx)        !! masses [kg]
    real(dp), intent(in) :: p(nx)        !! foundation force [N]
    real(dp), intent(in) :: x_0(nx)
    real(dp), intent(in) :: near(nx)     !! velocities near the roots [m/s]
    real(dp), intent(inout) :: v(nx)     !! v_0, then the roots [m/s]
    real(dp), intent(out) :: x(nx)
    real(dp), dimension(TOGETHER) :: w, c, inertia, eta, high, speed
    integer :: from, n, i, k

    do from = 1, nx, TOGETHER
      n = min(TOGETHER, nx - from + 1)
      do i = 1, n
        k = from + i - 1
        w(i) = max(abs(v(k)), tiny(w))
        c(i) = max(p(k), 0.0_dp)*(h/m(k))
        inertia(i) = of%v_ref*(1.0_dp + merge(of%alpha(k)*(h/m(k)), 0.0_dp, p(k) > 0.0_dp))
        high(i) = w(i)/inertia(i)
        eta(i) = max(abs(near(k))/of%v_ref, tiny(w))
      end do
      call logarithms(n, high)
      call logarithms(n, eta)
      call speed_by_friction(of, from, n, h, c, x_0(from), w, speed)
      do i = 1, n
        k = from + i - 1
        high(i) = max(high(i), LEAST)
        eta(i) = min(max(merge(eta(i), speed(i), near(k)*v(k) > 0.0_dp), LEAST), high(i))
      end do
      call find_roots(of, from, n, h, c, inertia, x_0(from), w, high, eta)
      speed(:n) = eta(:n)
      call exponentials(n, speed)
      do i = 1, n
        k = from + i - 1
        v(k) = merge(sign(of%v_ref*speed(i), v(k)), 0.0_dp, abs(v(k)) > 0.0_dp .and. eta(i) > LEAST)
        x(k) = stage_variable(of, k, h, x_0(k), eta(i), of%v_ref*speed(i))
      end do
    end do
  end subroutine implicit_speeds

  !> Roots of `balance` = w, from eta on, below `high`.
  pure subroutine find_roots(of, from, n, h, c, inertia, x_0, w, high, eta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: h
    real(dp), intent(in) :: c(n)         !! p h/m [m/s]
    real(dp), intent(in) :: inertia(n)   !! V* (1 + alpha h/m) [m/s]
    real(dp), intent(in) :: x_0(n)
    real(dp), intent(in) :: w(n)         !! [m/s]
    real(dp), intent(inout) :: high(n)
    real(dp), intent(inout) :: eta(n)
    real(dp), dimension(TOGETHER) :: low, left, grows, found
    real(dp) :: step
    integer :: i, k

    low(:n) = LEAST
    found(:n) = 0.0_dp
    do k = 1, MOST
      call balance(of, from, n, h, c, inertia, x_0, eta, left, grows)
      do i = 1, n
        step = (w(i) - left(i))/grows(i)
        low(i) = merge(eta(i), low(i), step > 0.0_dp)
        high(i) = merge(eta(i), high(i), step < 0.0_dp)
        step = merge(step, 0.5_dp*(low(i) + high(i)) - eta(i), eta(i) + step >= low(i) .and. eta(i) + step <= high(i))
        eta(i) = merge(eta(i), eta(i) + step, found(i) > 0.0_dp)
        found(i) = merge(1.0_dp, found(i), abs(step) < LAST_STEP)
      end do
      if (all(found(:n) > 0.0_dp)) exit
    end do
  end subroutine find_roots

  !> ln(|v|/V*), slightly above that at which friction alone balances w.
  pure subroutine speed_by_friction(of, from, n, h, c, x_0, w, eta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: h
    real(dp), intent(in) :: c(n)      !! p h/m [m/s]
    real(dp), intent(in) :: x_0(n)
    real(dp), intent(in) :: w(n)      !! [m/s]
    real(dp), intent(out) :: eta(n)
    real(dp), dimension(TOGETHER) :: x, psi, slope, y
    integer :: i, k

    do i = 1, n
      x(i) = stage_variable(of, from + i - 1, h, x_0(i), 0.0_dp, 0.0_dp)
      y(i) = w(i)/max(c(i)*of%a(from + i - 1), tiny(y))   ! asinh(exp(q)/2) >= q; below 1, exp(q) <= 2 sinh(1) y
      eta(i) = 2.4_dp*y(i)
    end do
    call state_effect(of, from, n, x, psi, slope)
    call logarithms(n, eta)
    do i = 1, n
      k = from + i - 1
      eta(i) = merge(eta(i), y(i), y(i) < 1.0_dp) - (of%f_ref(k) + of%b(k)*psi(i))/of%a(k)
    end do
  end subroutine speed_by_friction

  !> x of block k at the end of an implicit stage of speed v = V* exp(eta).
  pure function stage_variable(of, k, h, x_0, eta, v) result(x)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: k
    real(dp), intent(in) :: h
    real(dp), intent(in) :: x_0
    real(dp), intent(in) :: eta
    real(dp), intent(in) :: v      !! speed [m/s]
    real(dp) :: x

    if (of%evolution == AGEING) then
      x = (max(x_0, 0.0_dp) + h)/(1.0_dp + h*(v/of%d_c(k)))
    else
      x = (x_0 - h*(v/of%d_c(k))*eta)/(1.0_dp + h*(v/of%d_c(k)))
    end if
  end function stage_variable

  !> The left side of the equation of `implicit_speeds`, and its derivative by eta = ln(|v|/V*).
  pure subroutine balance(of, from, n, h, c, inertia, x_0, eta, left, grows)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: h            !! [s]
    real(dp), intent(in) :: c(n)         !! p h/m [m/s]
    real(dp), intent(in) :: inertia(n)   !! V* (1 + alpha h/m) [m/s]
    real(dp), intent(in) :: x_0(n)
    real(dp), intent(in) :: eta(n)
    real(dp), intent(out) :: left(n)     !! [m/s]
    real(dp), intent(out) :: grows(n)    !! [m/s]
    real(dp), dimension(TOGETHER) :: x, q, speed, x_slope, psi, psi_slope, value, slope
    real(dp) :: rate
    integer :: i, k

    speed(:n) = eta
    call exponentials(n, speed)
    do i = 1, n
      k = from + i - 1
      rate = h*(of%v_ref*speed(i)/of%d_c(k))
      x(i) = stage_variable(of, k, h, x_0(i), eta(i), of%v_ref*speed(i))
      x_slope(i) = x(i)
      if (of%evolution == SLIP_LAW) x_slope(i) = x(i) + eta(i) + 1.0_dp
      x_slope(i) = -rate*x_slope(i)/(1.0_dp + rate)
    end do
    call state_effect(of, from, n, x, psi, psi_slope)
    do i = 1, n
      k = from + i - 1
      q(i) = eta(i) + (of%f_ref(k) + of%b(k)*psi(i))/of%a(k)
    end do
    call asinh_of_exp(n, q, value, slope)
    do i = 1, n
      k = from + i - 1
      left(i) = inertia(i)*speed(i) + c(i)*of%a(k)*value(i)
      grows(i) = inertia(i)*speed(i) + c(i)*slope(i)*(of%a(k) + of%b(k)*psi_slope(i)*x_slope(i))
    end do
  end subroutine balance

  !> Velocities at which friction balances loads, p a asinh(...) + alpha |v| = |load|, and their derivatives. Blocks without
  !> contact, p <= 0, do not move.
  pure subroutine balanced_speeds(of, nx, load, p, log_theta, v, by_load, by_p, by_theta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: load(nx)       !! along +x [N]
    real(dp), intent(in) :: p(nx)          !! normal force [N]
    real(dp), intent(in) :: log_theta(nx)  !! ln of theta [s]
    real(dp), intent(out) :: v(nx)         !! [m/s]
    real(dp), intent(out) :: by_load(nx)   !! [m/(s N)]
    real(dp), intent(out) :: by_p(nx)      !! [m/(s N)]
    real(dp), intent(out) :: by_theta(nx)  !! by ln(theta) [m/s]
    real(dp), dimension(TOGETHER) :: x, psi, psi_slope, kappa, w, pressed, eta, value, slope
    real(dp) :: gain
    logical :: touches
    integer :: from, n, i, k

    do from = 1, nx, TOGETHER
      n = min(TOGETHER, nx - from + 1)
      call log_variables(of, from, n, log_theta(from), x)
      call state_effect(of, from, n, x, psi, psi_slope)
      do i = 1, n
        k = from + i - 1
        if (of%evolution == AGEING) psi_slope(i) = psi_slope(i)*x(i)
        kappa(i) = (of%f_ref(k) + of%b(k)*psi(i))/of%a(k)
        w(i) = merge(abs(load(k)), 0.0_dp, p(k) > 0.0_dp)
        pressed(i) = max(p(k), tiny(w))
      end do
      call speed_without_damping(of, from, n, w, pressed, eta)
      do i = 1, n
        eta(i) = min(max(eta(i) - kappa(i), LEAST), -LEAST)
      end do
      if (any(of%alpha(from:from + n - 1) > 0.0_dp)) call damp(of, from, n, pressed, x, w, eta)
      do i = 1, n
        kappa(i) = eta(i) + kappa(i)
      end do
      call asinh_of_exp(n, kappa, value, slope)
      call exponentials(n, eta)
      do i = 1, n
        k = from + i - 1
        touches = p(k) > 0.0_dp
        v(k) = of%v_ref*eta(i)
        gain = v(k)/(of%alpha(k)*v(k) + pressed(i)*of%a(k)*slope(i))
        v(k) = merge(sign(v(k), load(k)), 0.0_dp, touches .and. w(i) > 0.0_dp)
        by_load(k) = merge(gain, 0.0_dp, touches)
        by_p(k) = -sign(by_load(k), load(k))*of%a(k)*value(i)
        by_theta(k) = -sign(by_load(k), load(k))*pressed(i)*of%b(k)*slope(i)*psi_slope(i)
      end do
    end do
  end subroutine balanced_speeds

  !> The variables x from ln(theta).
  pure subroutine log_variables(of, from, n, log_theta, x)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: log_theta(n)   !! ln of theta [s]
    real(dp), intent(out) :: x(n)
    integer :: i

    x = log_theta
    call exponentials(n, x)
    if (of%evolution == AGEING) return
    do i = 1, n
      x(i) = of%v_ref*x(i)/of%d_c(from + i - 1)
    end do
    call logarithms(n, x)
  end subroutine log_variables

  !> ln(|v|/V*) + (f* + b psi)/a from p a asinh(...) = w.
  pure subroutine speed_without_damping(of, from, n, w, p, q)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: w(n)   !! [N]
    real(dp), intent(in) :: p(n)   !! [N]
    real(dp), intent(out) :: q(n)
    real(dp) :: y(TOGETHER)
    integer :: i

    do i = 1, n
      y(i) = w(i)/(p(i)*of%a(from + i - 1))
      q(i) = -2.0_dp*y(i)
    end do
    call exponentials(n, q)
    do i = 1, n
      q(i) = merge(2.0_dp*y(i)*(1.0_dp - y(i)*(1.0_dp - y(i)/1.5_dp)), 1.0_dp - q(i), y(i) < SMALL)
      q(i) = max(q(i), tiny(q))
    end do
    call logarithms(n, q)
    do i = 1, n
      q(i) = y(i) + q(i)
    end do
  end subroutine speed_without_damping

  !> eta = ln(|v|/V*) from that without damping, which is above: Newton's method on a convex function.
  pure subroutine damp(of, from, n, p, x, w, eta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: p(n)         !! [N]
    real(dp), intent(in) :: x(n)
    real(dp), intent(in) :: w(n)         !! [N]
    real(dp), intent(inout) :: eta(n)
    real(dp), dimension(TOGETHER) :: bound, inertia, left, grows, step
    integer :: i, k

    do i = 1, n
      inertia(i) = of%v_ref*of%alpha(from + i - 1)
      bound(i) = max(w(i), tiny(w))/(of%v_ref*max(of%alpha(from + i - 1), tiny(w)*1e200_dp))
    end do
    call logarithms(n, bound)
    do i = 1, n
      eta(i) = max(min(eta(i), bound(i)), LEAST)
    end do
    do k = 1, MOST
      call balance(of, from, n, 0.0_dp, p, inertia, x, eta, left, grows)
      do i = 1, n
        step(i) = max((w(i) - left(i))/grows(i), LEAST - eta(i))
        eta(i) = eta(i) + step(i)
      end do
      if (all(abs(step(:n)) < LAST_STEP)) exit
    end do
  end subroutine damp

  !> Rates of ln(theta) [1/s], and their derivatives by v and ln(theta).
  pure subroutine evolution_rates(of, nx, v, log_theta, rate, by_v, by_theta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: v(nx)          !! velocities [m/s]
    real(dp), intent(in) :: log_theta(nx)  !! ln of theta [s]
    real(dp), intent(out) :: rate(nx)
    real(dp), intent(out) :: by_v(nx)      !! [1/m]
    real(dp), intent(out) :: by_theta(nx)  !! [1/s]

    if (of%evolution == AGEING) then
      by_theta = -log_theta
      call exponentials(nx, by_theta)
      rate = by_theta - abs(v)/of%d_c
      by_theta = -by_theta
      by_v = -sign(1.0_dp/of%d_c, v)
    else
      rate = max(abs(v)/of%d_c, tiny(1.0_dp))
      call logarithms(nx, rate)
      by_v = -sign((rate + log_theta + 1.0_dp)/of%d_c, v)
      by_theta = -abs(v)/of%d_c
      rate = by_theta*(rate + log_theta)
    end if
  end subroutine evolution_rates
end module pyfric_rate_state
