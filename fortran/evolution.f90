!> The laws of rate-and-state friction: what they say of a block.
!>
!>     |f| = p mu + alpha |v|,   mu = a asinh( |v|/(2 V*) exp((f* + b psi)/a) ),   psi = ln(V* theta/D_c + V*/V_c)
!>
!>     ageing   dtheta/dt = 1 - |v| theta/D_c
!>     slip     dtheta/dt = -(|v| theta/D_c) ln(|v| theta/D_c)
!>
!> V*/V_c = 0 without a cut-off speed V_c. Only this module asks which law it is. A law evolves in a variable x, which is theta
!> or ln(V* theta/D_c), and is four functions: x after an implicit `stage`, with its slope, dx/dt, and the rate of ln(theta) with
!> its slopes. Procedures work on n blocks from number `from` on, at most `TOGETHER` where there are work arrays, so that vectors
!> speed them up and nothing is allocated.
!>
!> Sources: J. H. Dieterich, J. Geophys. Res. 84, 2161 (1979); A. L. Ruina, J. Geophys. Res. 88, 10359 (1983); the form with
!> asinh: J. R. Rice, N. Lapusta, K. Ranjith, J. Mech. Phys. Solids 49, 1865 (2001).
module pyfric_evolution
  use, intrinsic :: iso_fortran_env, only: int64
  use pyfric_kinds, only: dp, ip
  use pyfric_elementary, only: exponentials, logarithms, logs_of_1_plus
  implicit none (type, external)
  private
  public :: rate_state_t, new_rate_state, TOGETHER
  public :: stage, variable_rates, log_rates
  public :: from_theta, to_theta, from_log_theta, state_effect, asinh_of_exp

  !> Laws, with the numbers of pyfric.scene.laws.EVOLUTIONS.
  integer(ip), parameter :: AGEING = 1, SLIP_LAW = 2
  !> Variables.
  integer, parameter :: IN_THETA = 1, IN_LOG = 2
  integer, parameter :: TOGETHER = 64
  !> exp(-2 q) is lost beside 1 above this q.
  real(dp), parameter :: LOST = 20.0_dp
  !> What a law that a function does not know gives: NaN.
  real(dp), parameter :: NOT_KNOWN = transfer(int(z'7FF8000000000000', int64), 1.0_dp)

  type :: rate_state_t
    logical :: complete = .false.     !! there was enough memory
    logical :: known = .false.        !! the law is one of those above
    integer(ip) :: law = 0            !! of evolution
    integer :: variable = 0           !! in which it evolves
    real(dp) :: v_ref                 !! V* [m/s]
    real(dp) :: cut                   !! V*/V_c, 0 without a cut-off speed [-]
    real(dp) :: v_slip                !! speed from which a block slips [m/s]
    real(dp), allocatable :: a(:)     !! direct effect [-]
    real(dp), allocatable :: b(:)     !! evolution effect [-]
    real(dp), allocatable :: d_c(:)   !! D_c [m]
    real(dp), allocatable :: alpha(:) !! viscosity of slip [N s/m]
    real(dp), allocatable :: f_ref(:) !! f* [-]
  end type rate_state_t

  !> Numbers passed by Python, in this order.
  type :: numbers_t
    real(dp) :: law         !! of evolution
    real(dp) :: v_ref       !! V* [m/s]
    real(dp) :: cut         !! V*/V_c, 0 without a cut-off speed V_c [-]
    real(dp) :: v_slip      !! speed from which a block counts as slipping [m/s]
  end type numbers_t

contains

  pure function new_rate_state(nx, numbers, fields) result(of)
    integer, intent(in) :: nx               !! blocks
    real(dp), contiguous, intent(in) :: numbers(:)      !! see numbers_t
    real(dp), intent(in) :: fields(nx, 5)   !! a, b, D_c, alpha, f*
    type(rate_state_t) :: of
    type(numbers_t) :: given
    integer :: failed

    given = transfer(numbers, given)
    of%law = nint(given%law)
    of%known = .true.
    select case (of%law)
    case (AGEING)
      of%variable = IN_THETA
    case (SLIP_LAW)
      of%variable = IN_LOG
    case default
      of%known = .false.
    end select
    of%v_ref = given%v_ref
    of%cut = given%cut
    of%v_slip = given%v_slip
    allocate (of%a(nx), of%b(nx), of%d_c(nx), of%alpha(nx), of%f_ref(nx), stat=failed)
    of%complete = failed == 0
    if (.not. of%complete) return
    of%a(:) = fields(:, 1)
    of%b(:) = fields(:, 2)
    of%d_c(:) = fields(:, 3)
    of%alpha(:) = fields(:, 4)
    of%f_ref(:) = fields(:, 5)
  end function new_rate_state

  !> x at the end of an implicit stage, x = x_0 + h dx/dt, at speeds v = V* exp(eta), and its slope by eta.
  pure subroutine stage(of, from, n, h, x_0, eta, v, x, slope)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: h          !! [s]
    real(dp), intent(in) :: x_0(n)
    real(dp), intent(in) :: eta(n)
    real(dp), intent(in) :: v(n)       !! speeds [m/s]
    real(dp), intent(out) :: x(n)
    real(dp), intent(out) :: slope(n)
    real(dp) :: rate
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
    case default
      x = NOT_KNOWN
      slope = NOT_KNOWN
    end select
  end subroutine stage

  !> dx/dt.
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
    case default
      rate = NOT_KNOWN
    end select
  end subroutine variable_rates

  !> Rates of y = ln(theta) [1/s], and their slopes by v and y.
  pure subroutine log_rates(of, from, n, v, y, rate, by_v, by_y)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: v(n)       !! velocities [m/s]
    real(dp), intent(in) :: y(n)       !! theta in s
    real(dp), intent(out) :: rate(n)
    real(dp), intent(out) :: by_v(n)   !! [1/m]
    real(dp), intent(out) :: by_y(n)   !! [1/s]
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
        by_v(i) = -sign((rate(i) + y(i) + 1.0_dp)/d_c, v(i))
        by_y(i) = -abs(v(i))/d_c
        rate(i) = by_y(i)*(rate(i) + y(i))
      end do
    case default
      rate = NOT_KNOWN
      by_v = NOT_KNOWN
      by_y = NOT_KNOWN
    end select
  end subroutine log_rates

  !> x from theta [s].
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

  !> theta [s] from x.
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

  !> x from y = ln(theta), and its slope.
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

  !> psi from x, and its slope.
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
end module pyfric_evolution
