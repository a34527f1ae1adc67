! External procedures for f2py, with plain arrays as input and output. pyfric.core checks the input.

!> Steps of an explicit stepper, with contacts switched at their ends or located inside them.
subroutine advance(nx, nz, n_memory, n_counts, n_numbers, stages, n_columns, counts, numbers, table, located, rtol, t0, dt, &
                   n_steps, n_threads, keep_budget, max_switch, max_quiet, every, max_point, step, sub, y, rod, mode, corner, &
                   margin, loss, memory, dissipated, radiated, heat, parts, work, n_log, switch_i, switch_r, quiet_i, quiet_r, &
                   points, threshold, max_crossing, max_burst, fast, speeds, crossing_i, crossing_r, burst_i, burst_r, tried, &
                   block, t_block, status)
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use pyfric_model, only: model_t, new_model
  use pyfric_law, only: whole_memory
  use pyfric_rows, only: budget_t, new_budget, save_budget
  use pyfric_contact, only: contact_t, save_contact
  use pyfric_log, only: log_t, new_log, watch_speeds, save_log, save_speeds
  use pyfric_table_stepper, only: new_table
  use pyfric_status, only: NO_MEMORY, UNKNOWN_LAW
  use pyfric_stepping, only: method_t, run_t, advance_steps
  implicit none
  !f2py threadsafe
  integer(c_int), intent(in) :: nx                           !! blocks along the interface
  integer(c_int), intent(in) :: nz                           !! rows
  integer(c_int), intent(in) :: n_memory                     !! state variables of the law for each block
  integer(c_int), intent(in) :: n_counts                     !! length of counts
  integer(c_int), intent(in) :: n_numbers                    !! length of numbers
  integer(c_int), intent(in) :: counts(n_counts)             !! the scene, see pyfric_model
  real(c_double), intent(in) :: numbers(n_numbers)           !! the scene, see pyfric_model [SI]
  integer(c_int), intent(in) :: stages                       !! stages of the stepper
  integer(c_int), intent(in) :: n_columns                    !! columns of the table of the stepper
  real(c_double), intent(in) :: table(stages, n_columns)     !! see pyfric_table_stepper
  integer(c_int), intent(in) :: located                      !! 1: locate switches inside steps, 0: at step ends
  real(c_double), intent(in) :: rtol                         !! allowed error of an adaptive sub-step, over the effect of F_N/N_x
  real(c_double), intent(in) :: t0                           !! time of step 0 [s]
  real(c_double), intent(in) :: dt                           !! step [s]
  integer(c_int), intent(in) :: n_steps                      !! largest number of steps
  integer(c_int), intent(in) :: n_threads                    !! threads
  integer(c_int), intent(in) :: keep_budget                  !! 1: integrate works and dissipations
  integer(c_int), intent(in) :: max_switch                   !! largest number of switches in the log
  integer(c_int), intent(in) :: max_quiet                    !! largest number of starts and ends of slip in the log
  integer(c_int), intent(in) :: every                        !! steps between two points of the loading curve, 0: none
  integer(c_int), intent(in) :: max_point                    !! largest number of points
  real(c_double), intent(inout) :: step(1)                   !! steps made
  real(c_double), intent(inout) :: sub(1)                    !! longest sub-step that the error allows [s]
  real(c_double), intent(inout) :: y(nx, 4, nz)              !! u_x, u_z [m], v_x, v_z [m/s]
  real(c_double), intent(inout) :: rod(6)                    !! X, Z [m], phi [rad] and their rates
  integer(c_int), intent(inout) :: mode(nx)                  !! contact states
  integer(c_int), intent(inout) :: corner(nx)                !! 1: corner episode
  real(c_double), intent(inout) :: margin(nx)                !! margin of a stuck block to slip [N]
  real(c_double), intent(inout) :: loss(nx)                  !! switching loss [J]
  real(c_double), intent(inout) :: memory(n_memory, nx)      !! see pyfric_law
  real(c_double), intent(inout) :: dissipated(nz)            !! bond dissipation [J]
  real(c_double), intent(inout) :: radiated(nz)              !! part of bond dissipation by absorbing walls [J]
  real(c_double), intent(inout) :: heat(nx)                  !! friction heat [J]
  real(c_double), intent(inout) :: parts(nx, 2)              !! parts of heat above the kinetic strength, and by alpha [J]
  real(c_double), intent(inout) :: work(2)                   !! works of driver, and of forces on the top [J]
  integer(c_int), intent(out) :: n_log(5)                    !! logged switches, starts and ends of slip, points, crossings, bursts
  integer(c_int), intent(inout) :: switch_i(4, max_switch)   !! block from 0, old, new, corner
  real(c_double), intent(inout) :: switch_r(4, max_switch)   !! step, t [s], u_x [m], p [N]
  integer(c_int), intent(inout) :: quiet_i(nx + 1, max_quiet)  !! kind, contact states
  real(c_double), intent(inout) :: quiet_r(nx + 18, max_quiet) !! step, t [s], a point (see pyfric_energy), u_x [m]
  real(c_double), intent(inout) :: points(16, max_point)     !! points after each multiple of `every` steps, see pyfric_energy
  real(c_double), intent(in) :: threshold                    !! speed above which a block is fast [m/s]; 0: no threshold
  integer(c_int), intent(in) :: max_crossing                 !! largest number of passages through the threshold
  integer(c_int), intent(in) :: max_burst                    !! largest number of starts and ends of fast slip
  integer(c_int), intent(inout) :: fast(nx, 2)               !! +1, -1 fast to the right, left, 0 slow; 1: corner slip
  real(c_double), intent(inout) :: speeds(nx + 1)            !! v_x at the last step; largest |sum of v_x| in a burst [m/s]
  integer(c_int), intent(inout) :: crossing_i(4, max_crossing) !! block from 0, old, new, corner
  real(c_double), intent(inout) :: crossing_r(4, max_crossing) !! step, t [s], u_x [m], p [N]
  integer(c_int), intent(inout) :: burst_i(nx + 1, max_burst)  !! kind, contact states
  real(c_double), intent(inout) :: burst_r(nx + 19, max_burst) !! step, t [s], a point, u_x [m], largest |sum of v_x| [m/s]
  real(c_double), intent(out) :: tried                       !! number of computed steps and sub-steps
  integer(c_int), intent(out) :: block                       !! block at which a step failed, from 1; 0: no failure
  real(c_double), intent(out) :: t_block                     !! time at which a step failed [s]
  integer(c_int), intent(out) :: status                      !! see pyfric_status
  type(model_t) :: model
  type(contact_t) :: contact
  type(budget_t) :: budget
  type(log_t) :: log
  type(method_t) :: method
  type(run_t) :: run

  status = NO_MEMORY
  n_log = 0
  tried = 0
  block = 0
  t_block = t0
  model = new_model(counts, numbers)
  status = merge(NO_MEMORY, UNKNOWN_LAW, model%law%known)
  if (.not. model%complete) return
  contact = contact_t(mode, corner, margin, loss, whole_memory(model%law, nx, memory))
  budget = new_budget(model, dissipated, radiated, heat, parts(:, 1), parts(:, 2), work)
  log = new_log(nx, max_switch, max_quiet, every, max_point)
  if (threshold > 0) call watch_speeds(log, threshold, max_crossing, max_burst, fast, speeds)
  if (.not. (budget%complete .and. log%complete)) return
  method = method_t(new_table(stages, table), located == 1, rtol, t0, dt, n_steps, n_threads, keep_budget == 1)
  run%step = step(1)
  run%sub = sub(1)
  call advance_steps(model, method, run, y, rod, contact, budget, log)
  step = run%step
  sub = run%sub
  tried = run%tried
  block = run%block
  t_block = run%t
  status = run%status
  if (status == NO_MEMORY) return
  call save_contact(contact, mode, corner, margin, loss, memory)
  call save_budget(budget, dissipated, radiated, heat, parts(:, 1), parts(:, 2), work)
  call save_log(log, n_log, switch_i, switch_r, quiet_i, quiet_r, points)
  call save_speeds(log, fast, speeds, crossing_i, crossing_r, burst_i, burst_r)
end subroutine advance

!> All forces, accelerations and powers of a state, at fixed contact states.
subroutine evaluate(nx, nz, n_memory, n_counts, n_numbers, counts, numbers, t, n_times, y, rod, mode, memory, &
                    a, a_rod, f, p, f_t, dissipated, heat, work, status)
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use pyfric_model, only: model_t, new_model
  use pyfric_law, only: whole_memory
  use pyfric_rows, only: budget_t, new_budget
  use pyfric_evaluation, only: all_forces
  use pyfric_status, only: NO_MEMORY, UNKNOWN_LAW
  implicit none
  !f2py threadsafe
  integer(c_int), intent(in) :: nx                           !! blocks along the interface
  integer(c_int), intent(in) :: nz                           !! rows
  integer(c_int), intent(in) :: n_memory                     !! state variables of the law for each block
  integer(c_int), intent(in) :: n_counts                     !! length of counts
  integer(c_int), intent(in) :: n_numbers                    !! length of numbers
  integer(c_int), intent(in) :: counts(n_counts)             !! the scene, see pyfric_model
  real(c_double), intent(in) :: numbers(n_numbers)           !! the scene, see pyfric_model [SI]
  real(c_double), intent(in) :: t                            !! time [s]
  integer(c_int), intent(in) :: n_times                      !! number of equal evaluations, for timing
  real(c_double), intent(in) :: y(nx, 4, nz)                 !! u_x, u_z [m], v_x, v_z [m/s]
  real(c_double), intent(in) :: rod(6)                       !! X, Z [m], phi [rad] and their rates
  integer(c_int), intent(in) :: mode(nx)                     !! contact states
  real(c_double), intent(in) :: memory(n_memory, nx)         !! see pyfric_law
  real(c_double), intent(out) :: a(nx, 2, nz)                !! accelerations [m/s2]
  real(c_double), intent(out) :: a_rod(3)                    !! accelerations of X, Z [m/s2], phi [rad/s2]
  real(c_double), intent(out) :: f(nx)                       !! friction force along +x [N]
  real(c_double), intent(out) :: p(nx)                       !! foundation force [N]
  real(c_double), intent(out) :: f_t                         !! driver force [N]
  real(c_double), intent(out) :: dissipated(nz)              !! power in the bonds of each row [W]
  real(c_double), intent(out) :: heat(nx)                    !! friction power [W]
  real(c_double), intent(out) :: work(2)                     !! power of driver and of the forces on the top [W]
  integer(c_int), intent(out) :: status                      !! see pyfric_status
  type(model_t) :: model
  type(budget_t) :: power

  status = NO_MEMORY
  model = new_model(counts, numbers)
  status = merge(NO_MEMORY, UNKNOWN_LAW, model%law%known)
  if (.not. model%complete) return
  dissipated = 0
  heat = 0
  work = 0
  power = new_budget(model, dissipated, dissipated, heat, heat, heat, work)
  call all_forces(model, t, n_times, y, rod, mode, whole_memory(model%law, nx, memory), &
                  a, a_rod, f, p, f_t, power, status)
  dissipated = power%dissipated
  heat = power%heat
  work = power%work
end subroutine evaluate

!> Computes a point of the loading curve from a state.
subroutine curve_point(nx, nz, n_memory, n_counts, n_numbers, counts, numbers, t, y, rod, memory, dissipated, radiated, heat, &
                       loss, parts, work, keep_budget, point, status)
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use pyfric_model, only: model_t, new_model
  use pyfric_law, only: whole_memory
  use pyfric_energy, only: found => curve_point
  use pyfric_rows, only: budget_t, new_budget
  use pyfric_workspace, only: reserve, aligned, widen
  use pyfric_status, only: DONE, NO_MEMORY, UNKNOWN_LAW
  implicit none
  integer(c_int), intent(in) :: nx                           !! blocks along the interface
  integer(c_int), intent(in) :: nz                           !! rows
  integer(c_int), intent(in) :: n_memory                     !! state variables of the law for each block
  integer(c_int), intent(in) :: n_counts                     !! length of counts
  integer(c_int), intent(in) :: n_numbers                    !! length of numbers
  integer(c_int), intent(in) :: counts(n_counts)             !! the scene, see pyfric_model
  real(c_double), intent(in) :: numbers(n_numbers)           !! the scene, see pyfric_model [SI]
  real(c_double), intent(in) :: t                            !! time [s]
  real(c_double), intent(in) :: y(nx, 4, nz)                 !! u_x, u_z [m], v_x, v_z [m/s]
  real(c_double), intent(in) :: rod(6)                       !! X, Z [m], phi [rad] and their rates
  real(c_double), intent(in) :: memory(n_memory, nx)         !! see pyfric_law
  real(c_double), intent(in) :: dissipated(nz)               !! bond dissipation [J]
  real(c_double), intent(in) :: radiated(nz)                 !! part of bond dissipation by absorbing walls [J]
  real(c_double), intent(in) :: heat(nx)                     !! friction heat [J]
  real(c_double), intent(in) :: loss(nx)                     !! switching loss [J]
  real(c_double), intent(in) :: parts(nx, 2)                 !! parts of the heat, see `advance` [J]
  real(c_double), intent(in) :: work(2)                      !! works of driver, and of forces on the top [J]
  integer(c_int), intent(in) :: keep_budget                  !! 1: with the energy budget
  real(c_double), intent(out) :: point(16)                   !! see pyfric_energy [N, J]
  integer(c_int), intent(out) :: status                      !! see pyfric_status
  type(model_t) :: model
  type(budget_t) :: budget
  real(c_double), allocatable :: state(:, :)
  logical :: complete

  status = NO_MEMORY
  model = new_model(counts, numbers)
  status = merge(NO_MEMORY, UNKNOWN_LAW, model%law%known)
  complete = model%complete
  if (complete) budget = new_budget(model, dissipated, radiated, heat, parts(:, 1), parts(:, 2), work)
  complete = complete .and. budget%complete
  call reserve(model, 4*nz, 1, state, complete)
  if (.not. complete) return
  status = DONE
  call widen(model, y, state(aligned(state(:, 1)), 1))
  point = found(model, t, state(aligned(state(:, 1)), 1), rod, whole_memory(model%law, nx, memory), keep_budget == 1, &
                budget, loss)
end subroutine curve_point

!> Slip without inertia under rate-and-state friction.
subroutine slow_slip(nx, n_counts, n_numbers, n_points, n_passages, n_sums, counts, numbers, closed, load, load_u, load_v, &
                     load_a, p, p_u, p_v, p_a, limits, max_steps, times, threshold, h, q, v, a, points, fast, passed_i, passed_r, &
                     sums, made, t_end, status)
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use pyfric_model, only: model_t, new_model
  use pyfric_slow_slip, only: condensed_t, limits_t, phase_t, passages_t, work_t, new_condensed, new_work, begin_phase, &
                              advance_phase, end_phase
  use pyfric_status, only: NO_MEMORY, UNKNOWN_LAW
  implicit none
  !f2py threadsafe
  integer(c_int), intent(in) :: nx                           !! blocks along the interface
  integer(c_int), intent(in) :: n_counts                     !! length of counts
  integer(c_int), intent(in) :: n_numbers                    !! length of numbers
  integer(c_int), intent(in) :: n_points                     !! points of the loading curve
  integer(c_int), intent(in) :: n_passages                   !! largest number of passages, at least nx
  integer(c_int), intent(in) :: n_sums                       !! largest number of sums of velocities
  integer(c_int), intent(in) :: counts(n_counts)             !! the scene, see pyfric_model
  real(c_double), intent(in) :: numbers(n_numbers)           !! the scene, see pyfric_model [SI]
  integer(c_int), intent(in) :: closed(nx)                   !! 1: in contact
  real(c_double), intent(in) :: load(nx, 3)                  !! load on each block, see pyfric_slow_slip
  real(c_double), intent(in) :: load_u(nx, nx)               !! derivatives of load by displacements [N/m]
  real(c_double), intent(in) :: load_v(nx, nx)               !! derivatives of load by velocities [N s/m]
  real(c_double), intent(in) :: load_a(nx, nx)               !! derivatives of load by accelerations [kg]
  real(c_double), intent(in) :: p(nx, 3)                     !! normal force, with the same columns as load
  real(c_double), intent(in) :: p_u(nx, nx)                  !! derivatives of p by displacements [N/m]
  real(c_double), intent(in) :: p_v(nx, nx)                  !! derivatives of p by velocities [N s/m]
  real(c_double), intent(in) :: p_a(nx, nx)                  !! derivatives of p by accelerations [kg]
  real(c_double), intent(in) :: limits(9)                    !! see `limits_t` of pyfric_slow_slip
  integer(c_int), intent(in) :: max_steps                    !! largest number of steps
  real(c_double), intent(in) :: times(n_points)              !! times of the points, ascending, since the beginning [s]
  real(c_double), intent(in) :: threshold                    !! speed above which a block is fast; 0: no threshold [m/s]
  real(c_double), intent(inout) :: h(1)                      !! length of the next step [s]
  real(c_double), intent(inout) :: q(nx, 2)                  !! u [m], ln theta: on entry at the beginning, on return at t_end
  real(c_double), intent(inout) :: v(nx)                     !! velocities: on entry see `begin_phase`, on return at t_end [m/s]
  real(c_double), intent(out) :: a(nx)                       !! accelerations at t_end [m/s2]
  real(c_double), intent(inout) :: points(nx, 3, n_points)   !! u [m], ln theta, velocities [m/s]
  integer(c_int), intent(in) :: fast(nx)                     !! see `passages_t` of pyfric_slow_slip
  integer(c_int), intent(inout) :: passed_i(2, n_passages)   !! `of` in `passages_t`
  real(c_double), intent(inout) :: passed_r(nx + 2, n_passages)  !! `at` in `passages_t`
  real(c_double), intent(inout) :: sums(2, n_sums)           !! `sums` in `passages_t`
  integer(c_int), intent(out) :: made(3)                     !! numbers of steps made, of points reached, and of passages
  real(c_double), intent(out) :: t_end                       !! last time on the grid of time steps [s]
  integer(c_int), intent(out) :: status                      !! code of pyfric_slow_slip; if negative, minus a code of pyfric_status
  type(model_t) :: model
  type(condensed_t) :: s
  type(phase_t) :: phase
  type(passages_t) :: passages
  type(work_t) :: w
  integer :: i

  made = 0
  t_end = 0
  a = 0
  model = new_model(counts, numbers)
  status = -merge(NO_MEMORY, UNKNOWN_LAW, model%law%known)
  if (.not. model%complete) return
  s = new_condensed(nx, model%law, closed == 1, load, load_u, load_v, load_a, p, p_u, p_v, p_a)
  w = new_work(nx)
  if (.not. (s%complete .and. w%complete)) return
  call begin_phase(s, w, v, q)
  phase%h = h(1)
  phase%q = q
  phase%grid = q
  passages%threshold = threshold
  passages%fast = fast
  passages%of = passed_i
  passages%at = passed_r
  passages%sums = sums
  call advance_phase(s, limits_t(limits(1), limits(2), limits(3), limits(4:5), limits(6), limits(7), limits(8), limits(9), &
                                         max_steps), &
                     n_points, times, w, phase, points(:, :2, :), passages, status)
  h = phase%h
  q = phase%grid
  t_end = phase%t_grid
  made = [phase%steps, phase%n_points, passages%n]
  passed_i = passages%of
  passed_r = passages%at
  sums = passages%sums
  call end_phase(s, t_end, w, q, v, a)
  do i = 1, phase%n_points
    call end_phase(s, times(i), w, points(:, :2, i), points(:, 3, i))
  end do
end subroutine slow_slip

!> Quasi-static sequences of events of many runs, which share the slider and the protocol.
subroutine sequences(nx, n_routes, n_legs, n_runs, n_states, n_tables, n_counts, max_switch, max_quiet, max_point, scales, s, &
                     drive, loads, f_t, limits, stops, legs, max_changes, n_threads, fields, kinds, states, columns, tables, &
                     counts, numbers, switch_i, switch_r, quiet_i, quiet_r, points, n_log, status)
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use pyfric_pivots, only: slider_t
  use pyfric_sequence, only: leg_t
  use pyfric_sequences, only: new_slider, new_rules, new_leg, follow_all
  use pyfric_status, only: NO_MEMORY
  implicit none
  !f2py threadsafe
  integer(c_int), intent(in) :: nx                           !! blocks along the interface
  integer(c_int), intent(in) :: n_routes                     !! number of routes of the loads
  integer(c_int), intent(in) :: n_legs                       !! number of legs of the protocol
  integer(c_int), intent(in) :: n_runs                       !! number of runs
  integer(c_int), intent(in) :: n_states                     !! lengths of the arrays of a run, see pyfric_sequences
  integer(c_int), intent(in) :: n_tables
  integer(c_int), intent(in) :: n_counts
  integer(c_int), intent(in) :: max_switch                   !! largest number of switches in the log of a run
  integer(c_int), intent(in) :: max_quiet                    !! largest number of starts and ends of slip in the log of a run
  integer(c_int), intent(in) :: max_point                    !! largest number of points of the loading curve of a run
  real(c_double), intent(in) :: scales(6)                    !! the slider, with the next four; see slider_t of pyfric_pivots
  real(c_double), intent(in) :: s(2*nx, 2*nx)
  real(c_double), intent(in) :: drive(2*nx)
  real(c_double), intent(in) :: loads(2*nx, 2, n_routes)
  real(c_double), intent(in) :: f_t(2, n_routes)
  real(c_double), intent(in) :: limits(6)                    !! see rules_t of pyfric_sequence
  integer(c_int), intent(in) :: stops                        !! 1: stop before each change between events
  real(c_double), intent(in) :: legs(9, n_legs)              !! see leg_t of pyfric_sequence
  integer(c_int), intent(in) :: max_changes                  !! largest number of changes of contact state in each run
  integer(c_int), intent(in) :: n_threads                    !! threads
  real(c_double), intent(in) :: fields(nx, 4, n_runs)        !! see ground_t of pyfric_pivots: hold, slide, k_f [N/m], gap [m]
  integer(c_int), intent(in) :: kinds(nx, n_runs)            !! 0 never in contact, 1 contact without, 2 with friction
  integer(c_int), intent(inout) :: states(nx, n_states, n_runs)  !! runs, with the next four; see `restore` of pyfric_sequences
  real(c_double), intent(inout) :: columns(nx + 2, 2, n_runs)
  real(c_double), intent(inout) :: tables(3*nx + 1, nx + 2, n_tables, n_runs)
  integer(c_int), intent(inout) :: counts(n_counts, n_runs)
  real(c_double), intent(inout) :: numbers(4, n_runs)
  integer(c_int), intent(inout) :: switch_i(4, max_switch, n_runs)  !! logs, with the next four; see log_t of pyfric_sequence
  real(c_double), intent(inout) :: switch_r(4, max_switch, n_runs)
  integer(c_int), intent(inout) :: quiet_i(nx + 1, max_quiet, n_runs)
  real(c_double), intent(inout) :: quiet_r(3*nx + 3, max_quiet, n_runs)
  real(c_double), intent(inout) :: points(3, max_point, n_runs)
  integer(c_int), intent(inout) :: n_log(3, n_runs)          !! numbers of logged switches, starts and ends of slip, points
  integer(c_int), intent(inout) :: status(n_runs)            !! status of each run, see pyfric_status
  type(slider_t) :: slider
  type(leg_t) :: protocol(n_legs)
  integer :: i

  status = NO_MEMORY
  slider = new_slider(nx, n_routes, scales, s, drive, loads, f_t)
  if (.not. slider%complete) return
  do i = 1, n_legs
    protocol(i) = new_leg(legs(:, i))
  end do
  call follow_all(slider, new_rules(limits, nx, stops == 1), protocol, max_changes, n_threads, n_runs, &
                  [max_switch, max_quiet, max_point], fields, kinds, states, columns, tables, counts, numbers, &
                  switch_i, switch_r, quiet_i, quiet_r, points, n_log, status)
end subroutine sequences

!> n random numbers in [0, 1), from a key and a counter.
subroutine uniforms(n, key, counter, u)
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_long
  use, intrinsic :: iso_fortran_env, only: int64
  use pyfric_random, only: drawn => uniforms
  implicit none
  integer(c_int), intent(in) :: n                 !! numbers
  integer(c_long), intent(in) :: key(2)           !! see pyfric_random
  integer(c_long), intent(in) :: counter(4)       !! see pyfric_random
  real(c_double), intent(out) :: u(n)             !! numbers
  integer(int64) :: words(2), at(4)

  words = key
  at = counter
  u = drawn(words, at, n)
end subroutine uniforms

!> Replaces numbers by exp, log, or log(1 + x), see pyfric_elementary.
subroutine elementary(n, which, x)
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use pyfric_elementary, only: exponentials, logarithms, logs_of_1_plus
  implicit none
  integer(c_int), intent(in) :: n             !! numbers
  integer(c_int), intent(in) :: which         !! 0: exp, 1: log, 2: log(1 + x)
  real(c_double), intent(inout) :: x(n)       !! on entry arguments, on return values

  select case (which)
  case (0)
    call exponentials(n, x)
  case (1)
    call logarithms(n, x)
  case default
    call logs_of_1_plus(n, x)
  end select
end subroutine elementary

!> Makes additions in registers, for timing.
subroutine additions(n, width_of_sums, total)
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  use pyfric_peak, only: make => additions, WIDTH
  implicit none
  !f2py threadsafe
  integer(c_int), intent(in) :: n               !! additions to each sum
  integer(c_int), intent(out) :: width_of_sums  !! number of sums
  real(c_double), intent(out) :: total          !! sum of all results, n (1 + 2 + ... + width_of_sums)
  real(c_double) :: steps(WIDTH)
  integer :: i

  width_of_sums = WIDTH
  steps = [(real(i, c_double), i=1, WIDTH)]
  call make(n, steps, total)
end subroutine additions

!> Version and options of the compiler, and whether OpenMP is used.
subroutine build_info(compiler, options, openmp)
  use, intrinsic :: iso_c_binding, only: c_int
  use, intrinsic :: iso_fortran_env, only: compiler_version, compiler_options
  implicit none
  character(len=128), intent(out) :: compiler  !! version of the compiler
  character(len=1024), intent(out) :: options  !! options of the compiler
  integer(c_int), intent(out) :: openmp        !! 1: built with OpenMP

  compiler = compiler_version()
  options = compiler_options()
  openmp = 0
  !$ openmp = 1
end subroutine build_info
