!> The laws of rate-and-state friction for a block.
!>
!>     |f| = p mu + alpha |v|,   mu = a asinh( |v|/(2 V*) exp((f* + b psi)/a) ),   psi = ln(V* theta/D_c + V*/V_c)
!>
!>     ageing   dtheta/dt = 1 - |v| theta/D_c
!>     slip     dtheta/dt = -(|v| theta/D_c) ln(|v| theta/D_c)
!>     prz      dtheta/dt = 1 - (|v| theta/(2 D_c))^2
!>     nagata   dtheta/dt = 1 - |v| theta/D_c - (c/b) theta dmu/dt
!>
!> V*/V_c = 0 without a cut-off speed V_c. Only this module distinguishes the laws. A law evolves in a variable x, which is theta
!> or ln(V* theta/D_c). Three quantities define a law: x after an implicit `stage`, dx/dt, and the rate of ln(theta). Procedures
!> work on n blocks from number `from` on, so that compilers vectorise their loops. In procedures with work arrays, n is at most
!> `TOGETHER`, so that nothing is allocated.
!>
!> If a law contains the rate of stress dmu/dt, the sum x + (c/b) mu evolves without dmu/dt. Rates and stages then refer to this
!> sum (`add_stress`). psi follows from x alone. Stages of the sum have no closed form. `stage_by_newton` solves them.
!>
!> Sources: J. H. Dieterich, J. Geophys. Res. 84, 2161 (1979); A. L. Ruina, J. Geophys. Res. 88, 10359 (1983); the form with
!> asinh: J. R. Rice, N. Lapusta, K. Ranjith, J. Mech. Phys. Solids 49, 1865 (2001); prz: G. Perrin, J. R. Rice, G. Zheng, J. Mech.
!> Phys. Solids 43, 1461 (1995); K. Nagata, M. Nakatani, S. Yoshida, J. Geophys. Res. 117, B02314 (2012).
module pyfric_evolution
  use pyfric_kinds, only: dp, ip, NOT_KNOWN
  use pyfric_elementary, only: exponentials, logarithms, logs_of_1_plus
  implicit none (type, external)
  private
  public :: rate_state_t, new_rate_state, N_FIELDS, TOGETHER, MOST, LAST_STEP, LEAST
  public :: stage, variable_rates, log_rates, add_stress, take_stress
  public :: from_theta, to_theta, from_log_theta, state_effect, asinh_of_exp

  !> Codes of the laws, as in pyfric.scene.laws.EVOLUTIONS.
  integer(ip), parameter :: AGEING = 1, SLIP_LAW = 2, PRZ = 3, NAGATA = 4
  !> Codes of the variable in which a law evolves: theta, or ln(V* theta/D_c).
  integer, parameter :: IN_THETA = 1, IN_LOG = 2
  integer, parameter :: TOGETHER = 64
  integer, parameter :: N_FIELDS = 5   !! number of fields of N_x numbers
  !> Value of q above which 1 + exp(-2 q) is 1 within rounding.
  real(dp), parameter :: LOST = 20.0_dp
  !> Largest number of Newton steps for a root; size of the last step; largest |x| of a stage; smallest ln(|v|/V*).
  integer, parameter :: MOST = 100
  real(dp), parameter :: LAST_STEP = 1e-7_dp, FAR = 690.0_dp, LEAST = -600.0_dp

  type :: rate_state_t
    logical :: complete = .false.     !! whether memory was allocated
    logical :: known = .false.        !! whether the code of the law is known
    integer(ip) :: law = 0            !! code of the law of evolution
    integer :: variable = 0           !! code of the variable in which the law evolves
    real(dp) :: v_ref                 !! V* [m/s]
    real(dp) :: cut                   !! V*/V_c, 0 without a cut-off speed V_c [-]
    real(dp) :: v_slip                !! speed from which a block slips [m/s]
    logical :: stressed = .false.     !! whether the law has a rate of stress
    real(dp), allocatable :: stress(:) !! c/b if the law has a rate of stress, else 0
    real(dp), allocatable :: a(:)     !! direct effect [-]
    real(dp), allocatable :: b(:)     !! evolution effect [-]
    real(dp), allocatable :: d_c(:)   !! D_c [m]
    real(dp), allocatable :: alpha(:) !! viscosity of slip [N s/m]
    real(dp), allocatable :: f_ref(:) !! f* [-]
  end type rate_state_t

  !> Numbers passed by Python, in this order.
  type :: numbers_t
    real(dp) :: law         !! code of the law of evolution
    real(dp) :: v_ref       !! V* [m/s]
    real(dp) :: cut         !! V*/V_c, 0 without a cut-off speed V_c [-]
    real(dp) :: v_slip      !! speed from which a block counts as slipping [m/s]
    real(dp) :: c           !! c of the rate of stress [-]
  end type numbers_t

contains

  pure function new_rate_state(nx, numbers, fields) result(of)
    integer, intent(in) :: nx               !! blocks
    real(dp), contiguous, intent(in) :: numbers(:)      !! see numbers_t
    real(dp), intent(in) :: fields(nx, N_FIELDS)   !! a, b, D_c, alpha, f*
    type(rate_state_t) :: of
    type(numbers_t) :: given
    integer :: failed

    given = transfer(numbers, given)
    of%law = nint(given%law)
    of%known = .true.
    select case (of%law)
    case (AGEING)
      of%variable = IN_THETA
    case (PRZ)
      of%variable = IN_THETA
    case (SLIP_LAW)
      of%variable = IN_LOG
    case (NAGATA)
      of%variable = IN_LOG
      of%stressed = .true.
    case default
      of%known = .false.
    end select
    of%v_ref = given%v_ref
    of%cut = given%cut
    of%v_slip = given%v_slip
    allocate (of%a(nx), of%b(nx), of%d_c(nx), of%alpha(nx), of%f_ref(nx), of%stress(nx), stat=failed)
    of%complete = failed == 0
    if (.not. of%complete) return
    of%a(:) = fields(:, 1)
    of%b(:) = fields(:, 2)
    of%d_c(:) = fields(:, 3)
    of%alpha(:) = fields(:, 4)
    of%f_ref(:) = fields(:, 5)
    of%stress(:) = 0.0_dp
    if (of%stressed) of%stress(:) = given%c/of%b
  end function new_rate_state

  !> x at the end of an implicit stage, x = x_0 + h dx/dt, at speeds v = V* exp(eta), and the derivative of x by eta.
  pure subroutine stage(of, from, n, h, x_0, eta, v, x, slope)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: h          !! factor of dx/dt in the stage [s]
    real(dp), intent(in) :: x_0(n)
    real(dp), intent(in) :: eta(n)
    real(dp), intent(in) :: v(n)       !! speeds [m/s]
    real(dp), intent(out) :: x(n)
    real(dp), intent(out) :: slope(n)
    real(dp) :: rate, total
    integer :: i

    select case (of%law)
    case (AGEING)
      do i = 1, n
        rate = h*(v(i)/of%d_c(from + i - 1))
        x(i) = (max(x_0(i), 0.0_dp) + h)/(1.0_dp + rate)
        slope(i) = -rate*x(i)/(1.0_dp + rate)
      end do
    case (SLIP_LAW)
      do i = 1, n
        rate = h*(v(i)/of%d_c(from + i - 1))
        x(i) = (x_0(i) - rate*eta(i))/(1.0_dp + rate)
        slope(i) = -rate*(x(i) + eta(i) + 1.0_dp)/(1.0_dp + rate)
      end do
    case (PRZ)
      do i = 1, n
        rate = h*(0.5_dp*v(i)/of%d_c(from + i - 1))**2
        total = max(x_0(i), 0.0_dp) + h
        x(i) = 2.0_dp*total/(1.0_dp + sqrt(1.0_dp + 4.0_dp*rate*total))
        slope(i) = -2.0_dp*rate*x(i)*x(i)/(1.0_dp + 2.0_dp*rate*x(i))
      end do
    case (NAGATA)
      call stage_by_newton(of, from, n, h, x_0, eta, v, x, slope)
    case default
      x = NOT_KNOWN
      slope = NOT_KNOWN
    end select
  end subroutine stage

  !> Rates dx/dt of blocks.
  pure subroutine variable_rates(of, from, n, v, x, rate)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: v(n)       !! velocities [m/s]
    real(dp), intent(in) :: x(n)
    real(dp), intent(out) :: rate(n)
    integer :: i

    select case (of%law)
    case (AGEING)
      do i = 1, n
        rate(i) = 1.0_dp - abs(v(i))/of%d_c(from + i - 1)*x(i)
      end do
    case (SLIP_LAW)
      do i = 1, n
        rate(i) = max(abs(v(i))/of%v_ref, tiny(1.0_dp))
      end do
      call logarithms(n, rate)
      do i = 1, n
        rate(i) = -abs(v(i))/of%d_c(from + i - 1)*(x(i) + rate(i))
      end do
    case (PRZ)
      do i = 1, n
        rate(i) = 1.0_dp - (0.5_dp*abs(v(i))/of%d_c(from + i - 1)*x(i))**2
      end do
    case (NAGATA)
      rate = -x
      call exponentials(n, rate)
      do i = 1, n
        rate(i) = (of%v_ref*rate(i) - abs(v(i)))/of%d_c(from + i - 1)
      end do
    case default
      rate = NOT_KNOWN
    end select
  end subroutine variable_rates

  !> Rates of y [1/s], and their derivatives by v and y. y is ln(theta), or ln(theta) + (c/b) mu if the law has a rate of stress.
  pure subroutine log_rates(of, from, n, v, y, rate, by_v, by_y)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: v(n)       !! velocities [m/s]
    real(dp), intent(in) :: y(n)       !! theta in s
    real(dp), intent(out) :: rate(n)
    real(dp), intent(out) :: by_v(n)   !! derivatives of the rates by v [1/m]
    real(dp), intent(out) :: by_y(n)   !! derivatives of the rates by y [1/s]
    real(dp) :: d_c
    integer :: i

    select case (of%law)
    case (AGEING)
      by_y = -y
      call exponentials(n, by_y)
      do i = 1, n
        d_c = of%d_c(from + i - 1)
        rate(i) = by_y(i) - abs(v(i))/d_c
        by_y(i) = -by_y(i)
        by_v(i) = -sign(1.0_dp/d_c, v(i))
      end do
    case (SLIP_LAW)
      do i = 1, n
        rate(i) = max(abs(v(i))/of%d_c(from + i - 1), tiny(1.0_dp))
      end do
      call logarithms(n, rate)
      do i = 1, n
        d_c = of%d_c(from + i - 1)
        by_v(i) = -(rate(i) + y(i) + 1.0_dp)/d_c*sign(1.0_dp, v(i))
        by_y(i) = -abs(v(i))/d_c
        rate(i) = by_y(i)*(rate(i) + y(i))
      end do
    case (PRZ)
      by_y = y
      call exponentials(n, by_y)
      do i = 1, n
        d_c = 2.0_dp*of%d_c(from + i - 1)
        by_v(i) = -2.0_dp*v(i)/d_c*(by_y(i)/d_c)
        rate(i) = 1.0_dp/by_y(i) - (v(i)/d_c)*(v(i)*by_y(i)/d_c)
        by_y(i) = -1.0_dp/by_y(i) - (v(i)/d_c)*(v(i)*by_y(i)/d_c)
      end do
    case (NAGATA)
      do i = 1, n, TOGETHER
        call rates_with_stress(of, from + i - 1, min(TOGETHER, n - i + 1), v(i), y(i), rate(i), by_v(i), by_y(i))
      end do
    case default
      rate = NOT_KNOWN
      by_v = NOT_KNOWN
      by_y = NOT_KNOWN
    end select
  end subroutine log_rates

  !> Solves a stage without a closed form, by Newton's method within narrowing bounds. Iterations go on until the last block has
  !> its root.
  pure subroutine stage_by_newton(of, from, n, h, x_0, eta, v, x, slope)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: h          !! factor of dx/dt in the stage [s]
    real(dp), intent(in) :: x_0(n)
    real(dp), intent(in) :: eta(n)
    real(dp), intent(in) :: v(n)       !! speeds [m/s]
    real(dp), intent(out) :: x(n)
    real(dp), intent(out) :: slope(n)
    real(dp), dimension(TOGETHER) :: low, high, found, left, by_x, by_eta
    real(dp) :: step, stress
    integer :: i, k

    do i = 1, n
      k = from + i - 1
      low(i) = -FAR
      high(i) = FAR
      found(i) = 0.0_dp
      stress = of%stress(k)   ! mu is a eta + f* + b x, or 0 if this is negative
      x(i) = min(x_0(i), (x_0(i) - stress*(of%a(k)*eta(i) + of%f_ref(k)))/(1.0_dp + stress*of%b(k)))
      x(i) = max(min(x(i), FAR), -FAR)
    end do
    do k = 1, MOST
      call residual(of, from, n, h, x_0, eta, v, x, left, by_x, by_eta)
      do i = 1, n
        step = -left(i)/by_x(i)
        low(i) = merge(x(i), low(i), step > 0.0_dp)
        high(i) = merge(x(i), high(i), step < 0.0_dp)
        step = merge(step, 0.5_dp*(low(i) + high(i)) - x(i), x(i) + step >= low(i) .and. x(i) + step <= high(i))
        x(i) = merge(x(i), x(i) + step, found(i) > 0.0_dp)
        found(i) = merge(1.0_dp, found(i), abs(step) < LAST_STEP)
      end do
      if (all(found(:n) > 0.0_dp)) exit
    end do
    call residual(of, from, n, h, x_0, eta, v, x, left, by_x, by_eta)
    do i = 1, n
      slope(i) = -by_eta(i)/by_x(i)
    end do
  end subroutine stage_by_newton

  !> Residual of the equation of a stage, which grows with x, and derivatives of the residual. Nagata: x + (c/b) mu - h dx/dt - x_0.
  pure subroutine residual(of, from, n, h, x_0, eta, v, x, left, by_x, by_eta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: h          !! factor of dx/dt in the stage [s]
    real(dp), intent(in) :: x_0(n)
    real(dp), intent(in) :: eta(n)
    real(dp), intent(in) :: v(n)       !! speeds [m/s]
    real(dp), intent(in) :: x(n)
    real(dp), intent(out) :: left(n)
    real(dp), intent(out) :: by_x(n)
    real(dp), intent(out) :: by_eta(n)
    real(dp), dimension(TOGETHER) :: mu, heals
    real(dp) :: stress
    integer :: i, k

    select case (of%law)
    case (NAGATA)
      call friction(of, from, n, eta, x, mu, by_x, by_eta)
      heals(:n) = -x
      call exponentials(n, heals)
      do i = 1, n
        k = from + i - 1
        stress = of%stress(k)
        heals(i) = h*(of%v_ref*heals(i)/of%d_c(k))
        left(i) = x(i) + stress*mu(i) - heals(i) + h*(v(i)/of%d_c(k)) - x_0(i)
        by_x(i) = 1.0_dp + stress*by_x(i) + heals(i)
        by_eta(i) = stress*by_eta(i) + h*(v(i)/of%d_c(k))
      end do
    case default
      left = NOT_KNOWN
      by_x = NOT_KNOWN
      by_eta = NOT_KNOWN
    end select
  end subroutine residual

  !> mu at speeds V* exp(eta), and derivatives of mu by x and eta.
  pure subroutine friction(of, from, n, eta, x, mu, by_x, by_eta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: eta(n)
    real(dp), intent(in) :: x(n)
    real(dp), intent(out) :: mu(n)
    real(dp), intent(out) :: by_x(n)
    real(dp), intent(out) :: by_eta(n)
    real(dp), dimension(TOGETHER) :: psi, q
    integer :: i, k

    call state_effect(of, from, n, x, psi, by_x)
    do i = 1, n
      k = from + i - 1
      q(i) = eta(i) + (of%f_ref(k) + of%b(k)*psi(i))/of%a(k)
    end do
    call asinh_of_exp(n, q, mu, by_eta)
    do i = 1, n
      k = from + i - 1
      mu(i) = of%a(k)*mu(i)
      by_x(i) = of%b(k)*by_x(i)*by_eta(i)
      by_eta(i) = of%a(k)*by_eta(i)
    end do
  end subroutine friction

  !> eta = ln(|v|/V*), at least `LEAST`.
  pure subroutine log_speeds(of, n, v, eta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: n
    real(dp), intent(in) :: v(n)       !! velocities [m/s]
    real(dp), intent(out) :: eta(n)
    integer :: i

    do i = 1, n
      eta(i) = max(abs(v(i))/of%v_ref, tiny(1.0_dp))
    end do
    call logarithms(n, eta)
    eta = max(eta, LEAST)
  end subroutine log_speeds

  !> Rates and derivatives of `log_rates` for a law with a rate of stress. x is the result of a stage with h = 0.
  pure subroutine rates_with_stress(of, from, n, v, y, rate, by_v, by_y)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: v(n)       !! velocities [m/s]
    real(dp), intent(in) :: y(n)
    real(dp), intent(out) :: rate(n)
    real(dp), intent(out) :: by_v(n)   !! derivatives of the rates by v [1/m]
    real(dp), intent(out) :: by_y(n)   !! derivatives of the rates by y [1/s]
    real(dp), dimension(TOGETHER) :: eta, x_0, x, speed, heals
    integer :: i, k

    call log_speeds(of, n, v, eta)
    speed(:n) = eta(:n)
    call exponentials(n, speed)
    speed(:n) = of%v_ref*speed(:n)
    call from_log_theta(of, from, n, y, x_0, x)
    call stage(of, from, n, 0.0_dp, x_0, eta, speed, x, by_v)
    call residual(of, from, n, 0.0_dp, x_0, eta, speed, x, rate, by_y, heals)
    heals(:n) = -x(:n)
    call exponentials(n, heals)
    do i = 1, n
      k = from + i - 1
      heals(i) = of%v_ref*heals(i)/of%d_c(k)
      rate(i) = heals(i) - abs(v(i))/of%d_c(k)
      by_v(i) = -(heals(i)*by_v(i)/speed(i) + 1.0_dp/of%d_c(k))*merge(1.0_dp, -1.0_dp, v(i) >= 0.0_dp)
      by_y(i) = -heals(i)/by_y(i)
    end do
  end subroutine rates_with_stress

  !> Adds (c/b) mu to x or ln(theta), for a law with a rate of stress.
  pure subroutine add_stress(of, nx, v, x, evolves)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: v(nx)           !! velocities [m/s]
    real(dp), intent(in) :: x(nx)
    real(dp), intent(inout) :: evolves(nx)
    real(dp), dimension(TOGETHER) :: eta, mu, by_x, by_eta
    integer :: from, n, i

    if (.not. of%stressed) return
    do from = 1, nx, TOGETHER
      n = min(TOGETHER, nx - from + 1)
      call log_speeds(of, n, v(from), eta)
      call friction(of, from, n, eta, x(from), mu, by_x, by_eta)
      do i = 1, n
        evolves(from + i - 1) = evolves(from + i - 1) + of%stress(from + i - 1)*mu(i)
      end do
    end do
  end subroutine add_stress

  !> ln(theta) from y = ln(theta) + (c/b) mu, for a law with a rate of stress.
  pure subroutine take_stress(of, nx, v, y)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx
    real(dp), intent(in) :: v(nx)           !! velocities [m/s]
    real(dp), intent(inout) :: y(nx)
    real(dp), dimension(TOGETHER) :: eta, speed, x_0, x, slope
    integer :: from, n, i

    if (.not. of%stressed) return
    do from = 1, nx, TOGETHER
      n = min(TOGETHER, nx - from + 1)
      call log_speeds(of, n, v(from), eta)
      call from_log_theta(of, from, n, y(from), x_0, slope)
      speed(:n) = abs(v(from:from + n - 1))
      call stage(of, from, n, 0.0_dp, x_0, eta, speed, x, slope)
      do i = 1, n
        y(from + i - 1) = y(from + i - 1) + (x(i) - x_0(i))
      end do
    end do
  end subroutine take_stress

  !> The variable x from theta [s].
  pure subroutine from_theta(of, from, n, theta, x)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: theta(n)
    real(dp), intent(out) :: x(n)
    integer :: i

    select case (of%variable)
    case (IN_THETA)
      x = theta
    case default
      do i = 1, n
        x(i) = of%v_ref*theta(i)/of%d_c(from + i - 1)
      end do
      call logarithms(n, x)
    end select
  end subroutine from_theta

  !> theta [s] from the variable x.
  pure subroutine to_theta(of, from, n, x, theta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: x(n)
    real(dp), intent(out) :: theta(n)
    integer :: i

    theta = x
    if (of%variable == IN_THETA) return
    call exponentials(n, theta)
    do i = 1, n
      theta(i) = of%d_c(from + i - 1)/of%v_ref*theta(i)
    end do
  end subroutine to_theta

  !> The variable x from y = ln(theta), and the derivative of x by y.
  pure subroutine from_log_theta(of, from, n, y, x, slope)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: y(n)     !! theta in s
    real(dp), intent(out) :: x(n)
    real(dp), intent(out) :: slope(n)

    slope = y
    call exponentials(n, slope)
    call from_theta(of, from, n, slope, x)
    if (of%variable == IN_LOG) slope = 1.0_dp
  end subroutine from_log_theta

  !> psi from x, and the derivative of psi by x.
  pure subroutine state_effect(of, from, n, x, psi, slope)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: x(n)
    real(dp), intent(out) :: psi(n)
    real(dp), intent(out) :: slope(n)
    real(dp) :: ratio(TOGETHER)
    integer :: i

    if (of%variable == IN_THETA) then
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

  !> asinh(exp(q)/2), and the derivative by q.
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
end module pyfric_evolution
