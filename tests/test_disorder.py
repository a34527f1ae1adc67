"""The study of disorder, on two draws, and on a damaged copy without disorder."""

import disorder

import pyfric


def records(cases):
    return {
        case: tuple(
            pyfric.simulate(job.scene, job.t_end, job.options, progress=False)
            for job in disorder.jobs(*case)
        )
        for case in cases
    }


def test_lengths_stay_on_their_curve_and_front_speeds_do_not():
    clean, drawn = (0.0, 1), [(0.1, 1), (0.1, 2)]
    known = records([clean])
    none, wide = disorder.tables(known | records(drawn))["summary"].to_dict("records")
    assert none["rms_length"] == 0
    assert 1e-3 < wide["rms_length"] < 0.02
    assert wide["rms_ln_v_c_tau_over_p"] > 1.5 * none["rms_ln_v_c_tau_over_p"]
    twin = known | dict.fromkeys(drawn, known[clean])
    _, wide = disorder.tables(twin)["summary"].to_dict("records")
    assert wide["rms_length"] == 0
    assert wide["rms_ln_v_c_tau_over_p"] < 1.2 * none["rms_ln_v_c_tau_over_p"]
    assert disorder.figure(disorder.tables(twin)).caption
