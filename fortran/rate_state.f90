!> Rate-and-state friction under a row of blocks: no block rests, and each stage of a step is implicit in the speed of a block.
!>
!> pyfric_evolution gives the state of a block at the end of a stage as a function of its speed. The speed is then the root of
!> one equation. A block counts as slipping while |v| >= v_slip. Procedures work on `TOGETHER` blocks at once.
module pyfric_rate_state
  use pyfric_kinds, only: dp
  use pyfric_elementary, only: exponentials, logarithms
  use pyfric_evolution, only: rate_state_t, TOGETHER, MOST, LAST_STEP, LEAST, stage, variable_rates, add_stress, from_theta, &
                              to_theta, from_log_theta, state_effect, asinh_of_exp
  implicit none (type, external)
  private
  public :: rate_forces, rate_powers, begin_step, implicit_speeds, balanced_speeds

  !> Value of y below which 1 - exp(-2 y) is computed by a polynomial of degree 3.
  real(dp), parameter :: SMALL = 1e-5_dp

contains

  !> Friction force of each block along +x [N].
  pure subroutine rate_forces(of, nx, theta, v, p, f)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx              !! blocks
    real(dp), intent(in) :: theta(nx)      !! state variables theta [s]
    real(dp), intent(in) :: v(nx)          !! velocities [m/s]
    real(dp), intent(in) :: p(nx)          !! foundation force [N]
    real(dp), intent(out) :: f(nx)         !! friction forces [N]
    real(dp), dimension(TOGETHER) :: eta, psi, slope, value
    integer :: from, n, i, k

    call from_theta(of, 1, nx, theta, f)
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

  !> Friction power above the kinetic strength, which is 0 under this law, and power of alpha.
  pure subroutine rate_powers(of, nx, v, above, viscous)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx              !! blocks
    real(dp), intent(in) :: v(nx)          !! velocities [m/s]
    real(dp), intent(out) :: above(nx)     !! friction power above the kinetic strength [W]
    real(dp), intent(out) :: viscous(nx)   !! power of alpha [W]

    above = 0.0_dp
    viscous = of%alpha*v*v
  end subroutine rate_powers

  !> The variables x at the start of a step, and their rates.
  pure subroutine begin_step(of, nx, v, theta, x, rate)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx            !! blocks
    real(dp), intent(in) :: v(nx)        !! velocities [m/s]
    real(dp), intent(in) :: theta(nx)    !! state variables theta [s]
    real(dp), intent(out) :: x(nx)
    real(dp), intent(out) :: rate(nx)
    real(dp) :: bare(nx)

    call from_theta(of, 1, nx, theta, x)
    call variable_rates(of, 1, nx, v, x, rate)
    if (.not. of%stressed) return
    bare = x
    call add_stress(of, nx, v, bare, x)
  end subroutine begin_step

  !> Velocities, theta and rates of x at the end of an implicit stage:
  !>
  !>     v + (h/m) (alpha v + p a asinh(...)) = v_0 ,   x by `stage` .
  !>
  !> The left side grows with |v|, unless friction weakens faster than the step resolves. The root is found by Newton's method in
  !> ln(|v|/V*), within narrowing bounds. Iterations go on until the last block has its root.
  pure subroutine implicit_speeds(of, nx, h, m, p, x_0, near, v, theta, rate)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: nx            !! blocks
    real(dp), intent(in) :: h            !! step times the diagonal of the table [s]
    real(dp), intent(in) :: m(nx)        !! masses [kg]
    real(dp), intent(in) :: p(nx)        !! foundation force [N]
    real(dp), intent(in) :: x_0(nx)
    real(dp), intent(in) :: near(nx)     !! first guesses of the roots [m/s]
    real(dp), intent(inout) :: v(nx)     !! on entry v_0, on return the roots [m/s]
    real(dp), intent(out) :: theta(nx)   !! state variables theta [s]
    real(dp), intent(out) :: rate(nx)
    real(dp), dimension(TOGETHER) :: w, c, inertia, eta, high, speed, x, slope
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
      if (.not. all(near(from:from + n - 1)*v(from:from + n - 1) > 0.0_dp)) then
        call speed_by_friction(of, from, n, h, c, x_0(from), w, speed)
        do i = 1, n
          k = from + i - 1
          eta(i) = merge(eta(i), speed(i), near(k)*v(k) > 0.0_dp)
        end do
      end if
      do i = 1, n
        high(i) = max(high(i), LEAST)
        eta(i) = min(max(eta(i), LEAST), high(i))
      end do
      call find_roots(of, from, n, h, c, inertia, x_0(from), w, high, eta)
      call speeds_at(of, n, eta, speed)
      call stage(of, from, n, h, x_0(from), eta, speed, x, slope)
      do i = 1, n
        k = from + i - 1
        v(k) = merge(sign(speed(i), v(k)), 0.0_dp, abs(v(k)) > 0.0_dp .and. eta(i) > LEAST)
      end do
      call variable_rates(of, from, n, v(from), x, rate(from))
      call to_theta(of, from, n, x, theta(from))
    end do
  end subroutine implicit_speeds

  !> Speed |v| from eta = ln(|v|/V*).
  pure subroutine speeds_at(of, n, eta, speed)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: n
    real(dp), intent(in) :: eta(n)
    real(dp), intent(out) :: speed(n)    !! speeds [m/s]

    speed = eta
    call exponentials(n, speed)
    speed = of%v_ref*speed
  end subroutine speeds_at

  !> Roots of `balance` = w, from a first guess eta, below `high`.
  pure subroutine find_roots(of, from, n, h, c, inertia, x_0, w, high, eta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: h
    real(dp), intent(in) :: c(n)         !! p h/m [m/s]
    real(dp), intent(in) :: inertia(n)   !! V* (1 + alpha h/m) [m/s]
    real(dp), intent(in) :: x_0(n)
    real(dp), intent(in) :: w(n)         !! right sides of the equations [m/s]
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

  !> A value of ln(|v|/V*) slightly above the root of friction = w without the term v.
  pure subroutine speed_by_friction(of, from, n, h, c, x_0, w, eta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: h
    real(dp), intent(in) :: c(n)      !! p h/m [m/s]
    real(dp), intent(in) :: x_0(n)
    real(dp), intent(in) :: w(n)      !! right sides of the equations [m/s]
    real(dp), intent(out) :: eta(n)
    real(dp), dimension(TOGETHER) :: x, psi, slope, y, none
    integer :: i, k

    do i = 1, n
      y(i) = w(i)/max(c(i)*of%a(from + i - 1), tiny(y))   ! asinh(exp(q)/2) >= q; below 1, exp(q) <= 2 sinh(1) y
      eta(i) = 2.4_dp*y(i)
    end do
    if (of%stressed) then
      do i = 1, n
        x(i) = x_0(i) - of%stress(from + i - 1)*(of%a(from + i - 1)*y(i))
      end do
    else
      none(:n) = 0.0_dp
      call stage(of, from, n, h, x_0, none, none, x, slope)
    end if
    call state_effect(of, from, n, x, psi, slope)
    call logarithms(n, eta)
    do i = 1, n
      k = from + i - 1
      eta(i) = merge(eta(i), y(i), y(i) < 1.0_dp) - (of%f_ref(k) + of%b(k)*psi(i))/of%a(k)
    end do
  end subroutine speed_by_friction

  !> Left side of the equation of `implicit_speeds`, and its derivative by eta = ln(|v|/V*).
  pure subroutine balance(of, from, n, h, c, inertia, x_0, eta, left, grows)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: h            !! step times the diagonal of the table [s]
    real(dp), intent(in) :: c(n)         !! p h/m [m/s]
    real(dp), intent(in) :: inertia(n)   !! V* (1 + alpha h/m) [m/s]
    real(dp), intent(in) :: x_0(n)
    real(dp), intent(in) :: eta(n)
    real(dp), intent(out) :: left(n)     !! left sides of the equations [m/s]
    real(dp), intent(out) :: grows(n)    !! derivatives of the left sides by eta [m/s]
    real(dp), dimension(TOGETHER) :: x, q, speed, v, x_slope, psi, psi_slope, value, slope
    integer :: i, k

    speed(:n) = eta
    call exponentials(n, speed)
    v(:n) = of%v_ref*speed(:n)
    call stage(of, from, n, h, x_0, eta, v, x, x_slope)
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
    real(dp), intent(out) :: v(nx)         !! velocities [m/s]
    real(dp), intent(out) :: by_load(nx)   !! derivatives of v by load [m/(s N)]
    real(dp), intent(out) :: by_p(nx)      !! derivatives of v by p [m/(s N)]
    real(dp), intent(out) :: by_theta(nx)  !! derivatives of v by ln(theta) [m/s]
    real(dp), dimension(TOGETHER) :: x, x_slope, psi_slope, kappa, w, pressed, eta, value, slope
    real(dp) :: gain
    logical :: touches
    integer :: from, n, i, k

    do from = 1, nx, TOGETHER
      n = min(TOGETHER, nx - from + 1)
      call from_log_theta(of, from, n, log_theta(from), x, x_slope)
      do i = 1, n
        k = from + i - 1
        w(i) = merge(abs(load(k)), 0.0_dp, p(k) > 0.0_dp)
        pressed(i) = max(p(k), tiny(w))
      end do
      call resistance(of, from, n, x, w, pressed, kappa, psi_slope)
      call speed_without_damping(of, from, n, w, pressed, eta)
      do i = 1, n
        eta(i) = min(max(eta(i) - kappa(i), LEAST), -LEAST)
      end do
      if (any(of%alpha(from:from + n - 1) > 0.0_dp)) then
        call damp(of, from, n, pressed, x, w, eta)
        if (of%stressed) then
          call speeds_at(of, n, eta, slope)
          value(:n) = max(w(:n) - of%alpha(from:from + n - 1)*slope(:n), 0.0_dp)
          call resistance(of, from, n, x, value, pressed, kappa, psi_slope)
        end if
      end if
      do i = 1, n
        kappa(i) = eta(i) + kappa(i)
      end do
      call asinh_of_exp(n, kappa, value, slope)
      if (of%stressed) then
        do i = 1, n
          k = from + i - 1
          slope(i) = slope(i)/(1.0_dp + of%stress(k)*of%b(k)*psi_slope(i)*slope(i))
        end do
      end if
      call exponentials(n, eta)
      do i = 1, n
        k = from + i - 1
        psi_slope(i) = psi_slope(i)*x_slope(i)
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

  !> (f* + b psi)/a, and the derivative of psi by x, at speeds at which friction balances w.
  pure subroutine resistance(of, from, n, x, w, p, kappa, slope)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: x(n)      !! variable of the law, plus (c/b) |f|/p if the law has a rate of stress
    real(dp), intent(in) :: w(n)      !! right sides of the equations [N]
    real(dp), intent(in) :: p(n)      !! normal forces [N]
    real(dp), intent(out) :: kappa(n)
    real(dp), intent(out) :: slope(n)
    real(dp), dimension(TOGETHER) :: psi, bare
    integer :: i, k

    if (of%stressed) then
      do i = 1, n
        bare(i) = x(i) - of%stress(from + i - 1)*(w(i)/p(i))
      end do
      call state_effect(of, from, n, bare, psi, slope)
    else
      call state_effect(of, from, n, x, psi, slope)
    end if
    do i = 1, n
      k = from + i - 1
      kappa(i) = (of%f_ref(k) + of%b(k)*psi(i))/of%a(k)
    end do
  end subroutine resistance

  !> ln(|v|/V*) + (f* + b psi)/a, as the root of p a asinh(...) = w.
  pure subroutine speed_without_damping(of, from, n, w, p, q)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: w(n)   !! right sides of the equations [N]
    real(dp), intent(in) :: p(n)   !! normal forces [N]
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

  !> eta = ln(|v|/V*) with damping, by Newton's method from the larger value without damping. The equation is convex.
  pure subroutine damp(of, from, n, p, x, w, eta)
    type(rate_state_t), intent(in) :: of
    integer, intent(in) :: from
    integer, intent(in) :: n
    real(dp), intent(in) :: p(n)         !! normal forces [N]
    real(dp), intent(in) :: x(n)
    real(dp), intent(in) :: w(n)         !! right sides of the equations [N]
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
end module pyfric_rate_state
