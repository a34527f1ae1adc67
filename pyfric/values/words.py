"""Common words for names in pyfric, and lines of code to write instead of unknown names.

All unknown names are looked up here: fields, options, friction laws, attributes, functions,
commands, and words of the command line. `meant` returns the known name for a word. If there is no
such name, `line` returns the line to write. Capitals, spaces, hyphens and underscores are ignored.
"""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Iterable, Mapping

NAMES = """
V             velocity speed v driving_velocity drive_velocity driving_speed loading_rate pull_speed
F_T           force tangential_force friction_force load_force ft
t             time times
L_p_over_L    length L_p lp precursor_length
t_start       start time t begin
F_T_start     force peak
n_blocks      size blocks
F_N           load normal_force normal_load force N fn P weight
L             length slider_length lx
H             height slider_height ly lz
l             spacing dx block_size lattice_constant cell_size mesh resolution
K             driving_stiffness spring_stiffness machine_stiffness loading_stiffness spring
K             k_spring driver_stiffness spring_constant driving_spring machine spring_k
k             stiffness bond_stiffness
M             mass
mu_s          mu mus static_friction mu_static friction fs
mu_k          mud mu_d mu_dynamic kinetic_friction dynamic_friction fd
d_c           dc slip_weakening_distance critical_slip weakening_length slip_distance
eta           viscosity bond_viscosity
h             push_height pushing_height driving_height driver_height height_of_push
side          direction pushed_side
law           friction_law
stop_when     stop until end stop_condition
fidelity      engine model solver backend mode
stepper       integrator scheme
dt            time_step step delta_t
tolerance     tol precision error rtol_forces
threads       n_threads cores n_cores n_proc cpus num_threads
workers       n_jobs n_workers processes n_processes jobs parallel
sample        sampling save_every dt_output
dynamic       full full_dynamics fully_dynamic exact
quasistatic   static statics qs
main_events   main main_event first first_event mainshock event events
system_size   sliding slide system
linear        slip_weakening weakening coulomb amontons amontons_coulomb linear_weakening
rate_and_state rate_state rsf dieterich ruina
table         tabulated csv measured
run           simulate start
show          view open plot html
draw          sketch
info          summary print version about list_presets
sweep         scan
out           output o save
t_end         time duration tmax t_max t_stop tend end_time T
set           parameter param
simulate      run solve Simulation
presets       list_presets scenes
load          open read_record open_record load_record read_nc
preset        setup block system
"""
"""Known names, each with the words that stand for the name."""

MATERIAL = (
    'slider=pyfric.Slider.of_material("PMMA", width="6 mm", L="140 mm", H="75 mm", l="2.5 mm"), '
    'as in pyfric.preset("fig1", slider=...)'
)
RANDOM = "mu_s=pyfric.Spread(mean=0.7, std=0.02, seed=1); a run itself draws nothing"
GO_ON = 'simulate(record.scene, t_end, initial=record), with record = pyfric.load("run.nc")'
SAVED = 'record.save("run.nc") after the run, or checkpoint="run.nc" during it'
TABLES = "record.curve and record.events, which are data frames"
CHANGED = 'scene.replace(F_N="2 kN"), which returns another scene'

# fmt: off
LINES: Mapping[str, Mapping[str, str]] = {
    "": {
        "material E young youngs_modulus modulus nu poisson rho density B width thickness":
            MATERIAL,
        "N_x N_z nx nz n_blocks blocks n points": 'l="2.5 mm", the size of blocks: N_x = L/l + 1',
        "groove grooves grooved": 'pyfric.preset("grooves"), or contact=[True, False, ...]',
        "seed random_seed rng disorder heterogeneity random randomness": RANDOM,
        "resume restart continue go_on state initial_state start_from": GO_ON,
        "output out file filename path save save_path save_to save_as outfile": SAVED,
        "time duration tmax t_max t_stop tend end_time": 'simulate(scene, t_end="400 ms")',
        "verbose quiet silent bar progress_bar": "progress=True or progress=False",
        "n_events max_events number_of_events": 'stop_when="main_events = 3"',
        "size dimensions shape geometry_size": 'L="140 mm", H="75 mm"',
        "n_steps steps max_steps": 't_end="400 ms", with dt="1 us" for steps of this length',
        "callback hook": "progress=function, which is called about ten times per second",
        "t_start t_begin t0 start_time": "initial=record or initial=state, which have their time",
        "setup": 'pyfric.preset("setup1") or pyfric.preset("setup2")',
        "parallel workers n_workers n_jobs processes":
            "threads=2; runs side by side are those of pyfric.run_all and of pyfric.Sweep",
    },
    "record": {
        "precursors precursor_lengths L_p lengths": "pyfric.analysis.precursor_lengths(record)",
        "loading_curve loading forces": "record.curve",
        "to_pandas to_dataframe to_df dataframe df data": TABLES,
        "to_netcdf write export to_nc": 'record.save("run.nc")',
        "times time": 'record.curve["t"]',
        "force forces ft tangential_force": 'record.curve["F_T"]',
        "mu friction": 'record.curve["F_T"] / record.scene.F_N',
        "fronts front front_speed rupture_speed speed": "pyfric.analysis.fronts(record)",
        "sizes b_value": "pyfric.analysis.sizes(record)",
        "n_events count length_of_events": "len(record.events)",
        "n_precursors number_of_precursors": "len(pyfric.analysis.precursor_lengths(record))",
        "t_end duration end_time t_max": 'record.curve["t"].iloc[-1]',
        "peak_force max_force maximum_force F_max": 'record.curve["F_T"].max()',
        "catalogue catalog event_table slip_events": "record.events",
        "main_events mains mainshocks": 'record.events.query("is_main")',
        "to_excel to_parquet to_json": 'record.curve.to_excel("curve.xlsx"), as of any data frame',
        "energy energies budget": "record.curve, of a run with energies=True",
        "show draw figure": "record.plot()",
        "savefig save_figure": 'pyfric.figures.save_figure(record, "name")',
        "describe parameters info head print": "print(record), record.scene or record.method",
        "*": "print(record); its tables are record.curve and record.events",
        "u displacement displacements slip v velocity velocities":
            "record.final_state.y, or record.motion",
        "tau stress stresses p": "record.tau_before, record.tau_after and the same of p",
    },
    "scene": {
        "copy with_ update set modify change evolve": CHANGED,
        "run simulate events curve record results":
            'pyfric.simulate(scene, "400 ms"), whose record has curve and events',
        "save write to_file dump": 'scene.to_toml("scene.toml")',
        "show draw sketch": "scene.plot()",
        "describe parameters info print fields": "print(scene)",
        "to_dict to_json asdict dict": "scene.to_toml(), a text that Scene.from_toml reads",
        "mass": "scene.slider.M, of a block scene.m",
        "density rho wave_speed wave_speeds c_P c_S speed_of_sound":
            "print(scene), which shows them",
        "*": 'print(scene); scene.replace(F_N="2 kN") returns another scene',
    },
    "pyfric": {
        "*": "dir(pyfric); README begins with an example",
        "plot show draw": "record.plot()",
        "verify check self_test": "pyfric verify, in a shell",
        "read_csv read_curve": 'pyfric.measured.read("curve.csv")',
        "save": 'record.save("run.nc")',
    },
    "laws": {
        "coulomb amontons amontons_coulomb slip_weakening linear weakening":
            "pyfric.laws.LinearWeakening(), the default; d_c of the interface is its slip",
        "rate_state rsf dieterich ruina": "pyfric.laws.RateAndState(a=..., b=..., D_c=...)",
        "*": "one of pyfric.laws.__all__",
    },
    "measured": {
        "load open read_csv from_csv": 'pyfric.measured.read("curve.csv")',
        "*": "one of pyfric.measured.__all__",
    },
    "analysis": {
        "plot plot_precursors plot_events": "record.plot(), or a function of pyfric.figures",
        "b b_values": "pyfric.analysis.b_value(magnitudes), or pyfric.analysis.sizes(record)",
        "*": "one of pyfric.analysis.__all__",
    },
    "figures": {
        "*": "record.plot(), or one of pyfric.figures.__all__",
        "plot loading_curve curve": "record.plot(), or pyfric.figures.fig1b(record)",
        "save savefig": 'pyfric.figures.save_figure(figure, "name")',
        **{f"fig{n}": f"pyfric.figures.fig{n}a(record) or fig{n}b(record)" for n in (2, 3, 4)},
        "fig1": "pyfric.figures.fig1b(record)",
    },
    "shell": {
        "material E young youngs_modulus modulus nu poisson rho density B width thickness":
            "[slider.material] in the file of the scene, which pyfric scene SCENE prints",
        "N_x N_z nx nz n_blocks blocks n points": "--set 'l=2.5 mm'",
        "groove grooves grooved": "pyfric run grooves",
        "seed random_seed rng disorder heterogeneity random randomness":
            "--set 'mu_s={mean = 0.7, std = 0.02, seed = 1}'",
        "resume restart continue go_on state initial_state start_from": "--resume RECORD",
        "verbose": "nothing: progress is shown in a terminal, and --quiet prints errors only",
        "law": "--set law=linear, or [interface.law] in the file of the scene",
        "plot figure draw": "--figure STEM",
    },
    "command": {
        "presets list ls list_presets scenes": "pyfric scene fig1, or another name: {presets}",
        "materials": "pyfric.MATERIALS, in Python",
        "laws": "pyfric.laws.KINDS, in Python",
        "figures figure fig1b fig2a fig2b fig3a fig3b fig4a fig4b":
            "pyfric reproduce --out figures",
        "*": "pyfric --help, which lists the commands",
        "read measure measured load": "pyfric fit --help, or in Python pyfric.measured.read",
        "events precursors analysis analyse analyze stats":
            "pyfric info RECORD, or pyfric run ... --csv DIR",
        "export convert csv": "pyfric run ... --csv DIR, or in Python record.to_csv",
        "resume continue restart": "pyfric run SCENE --t-end TIME --out RECORD --resume",
    },
}
# fmt: on
"""Lines of code to write, by owner and unknown words. The owner "" means all owners."""


LONG = 4
"""Smallest number of letters of a word that may stand for a longer name with this word in it."""


def plain(word: str) -> str:
    """Return a word in small letters, without spaces, hyphens and underscores."""
    return re.sub(r"[^a-z0-9*]", "", word.casefold())


@functools.cache
def _names() -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for row in NAMES.split("\n"):
        name, *words = row.split() or [""]
        for word in words:
            found.setdefault(plain(word), []).append(name)
    return found


@functools.cache
def _lines(owner: str) -> dict[str, str]:
    return {plain(word): text for words, text in LINES[owner].items() for word in words.split()}


def meant(word: str, known: Iterable[str]) -> str:
    """Return the name of `known` that a word stands for, or ""."""
    known = list(known)
    own = {plain(name): name for name in known if name not in ("K", "k", "L", "l", "H", "h")}
    found = [own.get(plain(word), ""), *_names().get(plain(word), [])]
    return next((name for name in found if name in known), "")


def nearest(key: str, known: Iterable[str]) -> str:
    """Return the entry of `known` that `key` stands for, or the most similar entry, or ``""``."""
    if found := meant(key, known):
        return found
    key, names = key[:64], {name.casefold(): name for name in known}
    if found := difflib.get_close_matches(key.casefold(), names, n=1):
        return names[found[0]]
    begins = (name for name in known if key.startswith(name) or name.startswith(key))
    inside = (name for name in known if len(key) >= LONG and key in name)
    return next(iter((*begins, *inside)), "") if key else ""  # "Length" means L


def line(word: str, owner: str = "") -> str:
    """Return the line of code to write instead of a name that the owner lacks; "" if none."""
    return _lines(owner).get(plain(word), "")


def no_attribute(
    owner: str, name: str, obj: object, instead: str = "", known: Iterable[str] = ()
) -> AttributeError:
    """Return the error for an attribute that a scene, a record or a module lacks.

    Args:
        owner: a key of `LINES`.
        name: the attribute.
        obj: the scene, record or module.
        instead: the line to write; "" means the line in `LINES`.
        known: names of existing attributes.
    """
    instead = instead or line(name, owner)
    text = f"{'a ' * (owner in ('scene', 'record'))}{owner} has no {name!r}"
    if not (instead or name.startswith("_")):
        found = nearest(name, [n for n in known if len(n) >= LONG and not n.startswith("_")])
        place = owner if owner in ("scene", "record", "pyfric") else f"pyfric.{owner}"
        instead = f"{place}.{found}" if found else line("*", owner)
    return AttributeError(text + f"; write {instead}" * bool(instead), name=name, obj=obj)
