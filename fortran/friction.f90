!> Amontons-Coulomb friction: the force in a given contact state, and the change of that state at a step's end.
module pyfric_friction
  use pyfric_kinds, only: dp, ip
  use pyfric_model, only: model_t
  implicit none
  private
  public :: friction_force, next_mode, STUCK, OPEN_GAP

  !> Contact states; slipping blocks carry the sign of their motion, +1 or -1.
  integer(ip), parameter :: STUCK = 0, OPEN_GAP = 2

contains

  !> Stuck: f balances all other horizontal forces. Slipping: mu_k p against the motion. Open: none.
  pure subroutine friction_force(s, mode, other, p, f)
    type(model_t), intent(in) :: s
    integer(ip), intent(in) :: mode(s%nx)  !! contact states
    real(dp), intent(in) :: other(s%nx)    !! all other horizontal forces [N]
    real(dp), intent(in) :: p(s%nx)        !! foundation force [N]
    real(dp), intent(out) :: f(s%nx)       !! friction force on the blocks, along +x [N]
    integer :: i

    do i = 1, s%nx
      select case (mode(i))
      case (STUCK)
        f(i) = -other(i)
      case (OPEN_GAP)
        f(i) = 0.0_dp
      case default
        f(i) = -real(mode(i), dp)*(s%mu_k*p(i))
      end select
    end do
  end subroutine friction_force

  !> The contact state after a step (the paper's rule); v_x is set to zero where the motion has ended.
  pure elemental subroutine next_mode(mu_s, other, p, mode, v_x)
    real(dp), intent(in) :: mu_s         !! static friction coefficient [-]
    real(dp), intent(in) :: other        !! all other horizontal forces [N]
    real(dp), intent(in) :: p            !! foundation force [N]
    integer(ip), intent(inout) :: mode   !! contact state
    real(dp), intent(inout) :: v_x       !! velocity [m/s]

    if (p <= 0.0_dp) then
      mode = OPEN_GAP
      return
    end if
    select case (mode)
    case (STUCK)
      mode = at_rest()
    case (OPEN_GAP)
      if (v_x > 0.0_dp) then
        mode = 1
      else if (v_x < 0.0_dp) then
        mode = -1
      else
        mode = at_rest()
      end if
    case default
      if (real(mode, dp)*v_x > 0.0_dp) return
      v_x = 0.0_dp
      mode = at_rest()
    end select

  contains

    !> A block at rest sticks up to mu_s p; beyond, it slips where the other forces pull it.
    pure function at_rest() result(new)
      integer(ip) :: new

      if (abs(other) <= mu_s*p) then
        new = STUCK
      else if (other > 0.0_dp) then
        new = 1
      else
        new = -1
      end if
    end function at_rest
  end subroutine next_mode
end module pyfric_friction
