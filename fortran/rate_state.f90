!> Rate-and-state friction: no block rests, and friction depends on the speed v and on one state variable theta.
!>
!>     f = -sign(v) p a asinh( |v|/(2 V*) exp((f* + b psi)/a) ) - alpha v,   psi = ln(V* theta/D_c + V*/V_c)
!>     ageing  dtheta/dt = 1 - |v| theta/D_c          slip  dtheta/dt = -(|v| theta/D_c) ln(|v| theta/D_c)
!>
!> V*/V_c = 0 without a cut-off speed V_c. At given v both laws are linear, dx/dt = source - |v|/D_c x, in x = theta (ageing)
!> or x = ln(V* theta/D_c) (slip). So an implicit stage knows x for each v, and v is the root of one equation. A block counts
!> as slipping while |v| >= v_slip. All functions work on the N_x blocks at once, so that vectors speed them up.
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
  pure function variables_of(of, nx, theta) result(x)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: theta(nx)
    real(dp) :: x(nx)

    x = theta
    if (of%evolution /= SLIP_LAW) return
    x = of%v_ref*theta/of%d_c
    call logarithms(nx, x)
  end function variables_of

  !> theta [s] from the variables x.
  pure function thetas_of(of, nx, x) result(theta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: x(nx)
    real(dp) :: theta(nx)

    theta = x
    if (of%evolution /= SLIP_LAW) return
    call exponentials(nx, theta)
    theta = of%d_c/of%v_ref*theta
  end function thetas_of

  !> dx/dt.
  pure function variable_rates(of, nx, v, x) result(rate)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: v(nx)      !! velocities [m/s]
    real(dp), intent(in) :: x(nx)
    real(dp) :: rate(nx), eta(nx)

    if (of%evolution == AGEING) then
      rate = 1.0_dp - abs(v)/of%d_c*x
    else
      eta = max(abs(v)/of%v_ref, tiny(1.0_dp))
      call logarithms(nx, eta)
      rate = -abs(v)/of%d_c*(x + eta)
    end if
  end function variable_rates

  !> psi from x, and its derivative by it.
  pure subroutine state_effect(of, nx, x, psi, slope)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: x(nx)
    real(dp), intent(out) :: psi(nx)
    real(dp), intent(out) :: slope(nx)
    real(dp) :: ratio(nx)

    if (of%evolution == AGEING) then
      ratio = of%v_ref*x/of%d_c + of%cut
      psi = max(ratio, tiny(1.0_dp))
      call logarithms(nx, psi)
      slope = of%v_ref/of%d_c/ratio
    else if (of%cut > 0.0_dp) then
      ratio = x
      call exponentials(nx, ratio)
      psi = ratio + of%cut
      call logarithms(nx, psi)
      slope = ratio/(ratio + of%cut)
    else
      psi = x
      slope = 1.0_dp
    end if
  end subroutine state_effect

  !> asinh(exp(q)/2), and its derivative by q.
  pure subroutine asinh_of_exp(nx, q, value, slope)
    integer, intent(in) :: nx
    real(dp), intent(in) :: q(nx)
    real(dp), intent(out) :: value(nx)
    real(dp), intent(out) :: slope(nx)
    real(dp) :: s(nx), root(nx)

    value = q
    slope = 1.0_dp
    if (all(q > LOST)) return
    s = merge(-2.0_dp*q, q, q > 0.0_dp)
    call exponentials(nx, s)
    where (q > 0.0_dp)
      root = sqrt(1.0_dp + 4.0_dp*s)
      value = 2.0_dp*s/(1.0_dp + root)
      slope = 1.0_dp/root
    else where
      root = sqrt(1.0_dp + 0.25_dp*s*s)
      value = 0.5_dp*s + 0.25_dp*s*s/(1.0_dp + root)
      slope = 0.5_dp*s/root
    end where
    call logs_of_1_plus(nx, value)
    value = value + max(q, 0.0_dp)
  end subroutine asinh_of_exp

  !> Friction force of each block along +x [N].
  pure subroutine rate_forces(of, nx, theta, v, p, f)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx              !! blocks
    real(dp), intent(in) :: theta(nx)      !! [s]
    real(dp), intent(in) :: v(nx)          !! velocities [m/s]
    real(dp), intent(in) :: p(nx)          !! foundation force [N]
    real(dp), intent(out) :: f(nx)         !! [N]
    real(dp) :: x(nx), eta(nx), psi(nx), slope(nx), value(nx)

    x = variables_of(of, nx, theta)
    call state_effect(of, nx, x, psi, slope)
    eta = max(abs(v)/of%v_ref, tiny(1.0_dp))
    call logarithms(nx, eta)
    eta = eta + (of%f_ref + of%b*psi)/of%a
    call asinh_of_exp(nx, eta, value, slope)
    f = merge(-sign(of%a*value*p, v) - of%alpha*v, 0.0_dp, p > 0.0_dp .and. abs(v) > 0.0_dp)
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
    real(dp), dimension(nx) :: w, c, inertia, eta, low, high, high_by_friction, left, grows, step, speed
    logical :: done(nx)
    integer :: k

    w = max(abs(v), tiny(w))
    c = max(p, 0.0_dp)*(h/m)
    inertia = of%v_ref*(1.0_dp + merge(of%alpha*(h/m), 0.0_dp, p > 0.0_dp))
    low = LEAST
    high = w/inertia
    call logarithms(nx, high)
    high = max(high, LEAST)
    eta = max(abs(near)/of%v_ref, tiny(w))
    call logarithms(nx, eta)
    high_by_friction = speed_by_friction(of, nx, h, c, x_0, w)
    eta = merge(eta, high_by_friction, near*v > 0.0_dp)
    eta = min(max(eta, low), high)
    done = .false.
    do k = 1, MOST
      call balance(of, nx, h, c, inertia, x_0, eta, left, grows)
      step = (w - left)/grows
      where (step > 0.0_dp) low = eta
      where (step < 0.0_dp) high = eta
      where (.not. (eta + step >= low .and. eta + step <= high)) step = 0.5_dp*(low + high) - eta
      eta = merge(eta, eta + step, done)
      done = done .or. abs(step) < LAST_STEP
      if (all(done)) exit
    end do
    speed = eta
    call exponentials(nx, speed)
    v = merge(sign(of%v_ref*speed, v), 0.0_dp, abs(v) > 0.0_dp .and. eta > LEAST)
    speed = of%v_ref*speed
    x = stage_variables(of, nx, h, x_0, eta, speed)
  end subroutine implicit_speeds

  !> ln(|v|/V*), slightly above that at which friction alone balances w.
  pure function speed_by_friction(of, nx, h, c, x_0, w) result(eta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: h
    real(dp), intent(in) :: c(nx)      !! p h/m [m/s]
    real(dp), intent(in) :: x_0(nx)
    real(dp), intent(in) :: w(nx)      !! [m/s]
    real(dp) :: eta(nx), x(nx), psi(nx), slope(nx), none(nx), y(nx)

    none = 0.0_dp
    x = stage_variables(of, nx, h, x_0, none, none)
    call state_effect(of, nx, x, psi, slope)
    y = w/max(c*of%a, tiny(y))   ! asinh(exp(q)/2) >= q; below 1, exp(q) <= 2 sinh(1) y
    eta = 2.4_dp*y
    call logarithms(nx, eta)
    eta = merge(eta, y, y < 1.0_dp) - (of%f_ref + of%b*psi)/of%a
  end function speed_by_friction

  !> x at the end of an implicit stage of speed v = V* exp(eta).
  pure function stage_variables(of, nx, h, x_0, eta, v) result(x)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: h
    real(dp), intent(in) :: x_0(nx)
    real(dp), intent(in) :: eta(nx)
    real(dp), intent(in) :: v(nx)      !! speed [m/s]
    real(dp) :: x(nx)

    if (of%evolution == AGEING) then
      x = (x_0 + h)/(1.0_dp + h*(v/of%d_c))
    else
      x = (x_0 - h*(v/of%d_c)*eta)/(1.0_dp + h*(v/of%d_c))
    end if
  end function stage_variables

  !> The left side of the equation of `implicit_speeds`, and its derivative by eta = ln(|v|/V*).
  pure subroutine balance(of, nx, h, c, inertia, x_0, eta, left, grows)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: h            !! [s]
    real(dp), intent(in) :: c(nx)        !! p h/m [m/s]
    real(dp), intent(in) :: inertia(nx)  !! V* (1 + alpha h/m) [m/s]
    real(dp), intent(in) :: x_0(nx)
    real(dp), intent(in) :: eta(nx)
    real(dp), intent(out) :: left(nx)    !! [m/s]
    real(dp), intent(out) :: grows(nx)   !! [m/s]
    real(dp), dimension(nx) :: x, q, v, speed, rate, x_slope, psi, psi_slope, value, slope

    speed = eta
    call exponentials(nx, speed)
    v = of%v_ref*speed
    x = stage_variables(of, nx, h, x_0, eta, v)
    rate = h*(v/of%d_c)
    x_slope = -rate*x/(1.0_dp + rate)
    if (of%evolution == SLIP_LAW) x_slope = -rate*(x + eta + 1.0_dp)/(1.0_dp + rate)
    call state_effect(of, nx, x, psi, psi_slope)
    q = eta + (of%f_ref + of%b*psi)/of%a
    call asinh_of_exp(nx, q, value, slope)
    left = inertia*speed + c*of%a*value
    grows = inertia*speed + c*slope*(of%a + of%b*psi_slope*x_slope)
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
    real(dp), dimension(nx) :: x, psi, psi_slope, kappa, w, pressed, eta, value, slope, gain

    x = log_theta
    call exponentials(nx, x)
    x = variables_of(of, nx, x)
    call state_effect(of, nx, x, psi, psi_slope)
    if (of%evolution == AGEING) psi_slope = psi_slope*x
    kappa = (of%f_ref + of%b*psi)/of%a
    w = merge(abs(load), 0.0_dp, p > 0.0_dp)
    pressed = max(p, tiny(w))
    eta = min(max(speed_without_damping(of, nx, w, pressed) - kappa, LEAST), -LEAST)
    if (any(of%alpha > 0.0_dp)) then
      eta = min(eta, -LEAST)
      call damp(of, nx, pressed, x, w, eta)
    end if
    call asinh_of_exp(nx, eta + kappa, value, slope)
    v = eta
    call exponentials(nx, v)
    v = of%v_ref*v
    gain = v/(of%alpha*v + pressed*of%a*slope)
    v = merge(sign(v, load), 0.0_dp, p > 0.0_dp .and. w > 0.0_dp)
    by_load = merge(gain, 0.0_dp, p > 0.0_dp)
    by_p = -sign(by_load, load)*of%a*value
    by_theta = -sign(by_load, load)*pressed*of%b*slope*psi_slope
  end subroutine balanced_speeds

  !> ln(|v|/V*) + (f* + b psi)/a from p a asinh(...) = w.
  pure function speed_without_damping(of, nx, w, p) result(q)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: w(nx)   !! [N]
    real(dp), intent(in) :: p(nx)   !! [N]
    real(dp) :: q(nx), y(nx)

    y = w/(p*of%a)
    q = -2.0_dp*y
    call exponentials(nx, q)
    q = merge(2.0_dp*y*(1.0_dp - y*(1.0_dp - y/1.5_dp)), 1.0_dp - q, y < SMALL)
    q = max(q, tiny(q))
    call logarithms(nx, q)
    q = y + q
  end function speed_without_damping

  !> eta = ln(|v|/V*) from that without damping, which is above: Newton's method on a convex function.
  pure subroutine damp(of, nx, p, x, w, eta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: p(nx)        !! [N]
    real(dp), intent(in) :: x(nx)
    real(dp), intent(in) :: w(nx)        !! [N]
    real(dp), intent(inout) :: eta(nx)
    real(dp) :: bound(nx), left(nx), grows(nx), step(nx)
    integer :: k

    bound = max(w, tiny(w))/(of%v_ref*max(of%alpha, tiny(w)*1e200_dp))
    call logarithms(nx, bound)
    eta = max(min(eta, bound), LEAST)
    do k = 1, MOST
      call balance(of, nx, 0.0_dp, p, of%v_ref*of%alpha, x, eta, left, grows)
      step = max((w - left)/grows, LEAST - eta)
      eta = eta + step
      if (all(abs(step) < LAST_STEP)) exit
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
    real(dp) :: logs(nx)

    if (of%evolution == AGEING) then
      by_theta = -log_theta
      call exponentials(nx, by_theta)
      rate = by_theta - abs(v)/of%d_c
      by_theta = -by_theta
      by_v = -sign(1.0_dp/of%d_c, v)
    else
      logs = max(abs(v)/of%d_c, tiny(1.0_dp))
      call logarithms(nx, logs)
      rate = -abs(v)/of%d_c*(logs + log_theta)
      by_theta = -abs(v)/of%d_c
      by_v = -sign((logs + log_theta + 1.0_dp)/of%d_c, v)
    end if
  end subroutine evolution_rates
end module pyfric_rate_state
