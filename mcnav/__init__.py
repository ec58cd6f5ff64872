"""Monte Carlo covariance analysis for inertial navigation: where is linear covariance analysis valid?

The four pieces, on labelled frames (the notebook ``mcnav/docs/tutorials/trajectory_4.ipynb`` uses them in turn)
    the sampler   ``Errors(…).draw(samples, seed)``     statistical initial-condition and equipment errors
    the runner    ``simulate(system, draws, jobs)``     nonlinear truth and indicated trajectories, in parallel: joblib
    linear        ``partials(system, errors)``,         the partial-derivative matrix P,
                  ``propagate_covariance(P, S)``        and P S P'
    the analysis  ``compare(covariance, outputs, …)``   the sample covariance against P S P', with confidence intervals

    ``run(campaign, folder)`` does all of it, stores every sample and writes a report.

Frames and signs of the reentry (for cruise and hover see `mcnav.systems.steady.truth`)
    Motion is planar, eastward in the equatorial plane of a spherical, rotating earth, with the geocentric polar state
    ``(r, theta, r_dot, theta_dot)``. Specific forces are ``f_x``, horizontal and positive east, and ``f_z``, vertical
    and positive **down**. The reference axes of the instruments are horizontal and vertical at the start of
    navigation. Navigation error = indicated - actual.

Units
    SI and radians; other units (km, deg/h, ug, ppm) only in campaign files, tables and reports.

Order of the error sources of the reentry (columns of P)
    altitude, range, altitude_rate, range_rate, misalignment, gyro_drift, bias_x, bias_z, scale_factor_x,
    scale_factor_z, cross_axis_x, cross_axis_z. Range and range rate are arc lengths at the radius of the start.

Order of its outputs (rows of P)
    altitude, range, altitude_rate, range_rate. Range and range rate are arc lengths at the earth's radius.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mcnav.analysis.linear_answer import LinearAnswer
    from mcnav.analysis.tuning import Tuning
    from mcnav.contract.history import Epochs, History, Panel
    from mcnav.contract.quantities import Output, Source
    from mcnav.contract.samples import SimulationResult
    from mcnav.errors import CampaignError, RunFolderError
    from mcnav.frames.allocation import AllocationResult, allocate
    from mcnav.frames.answers import LinearResult, lincov
    from mcnav.frames.campaigns import Campaign, read_campaign
    from mcnav.frames.comparison import compare
    from mcnav.frames.covariance_verdict import CovarianceVerdict
    from mcnav.frames.linear import partials, propagate_covariance
    from mcnav.frames.runs import RunResult, check_scenario, open_run, run, run_campaign, sweep
    from mcnav.frames.simulation import simulate
    from mcnav.identification.identify import IdentifiedNoise, identify_noise
    from mcnav.judgement.verdict import Judgement
    from mcnav.logs.imu_log import ImuLog, read_imu_log
    from mcnav.logs.tables import read_table
    from mcnav.logs.track import Track, read_track
    from mcnav.sampler.errors import Errors
    from mcnav.sampler.sizes import fixed, normal, student_t, table, triangular, truncated_normal, uniform
    from mcnav.studies.judge import judge_recording
    from mcnav.studies.linear_covariance import linear_covariance
    from mcnav.studies.recordings import RecordingFiles
    from mcnav.studies.tune import tune
    from mcnav.systems.closed_loop.declarations import (
        Attitude,
        ClosedLoop,
        Correction,
        Filter,
        GaussMarkov,
        Measurement,
        Phase,
        Trigger,
        White,
    )
    from mcnav.systems.closed_loop.strapdown.navigator import Strapdown
    from mcnav.systems.user.simulated import Innovations, Simulated
    from mcnav.workflow.analyse import report_run, samples_of
    from mcnav.workflow.compare import RunComparison, compare_runs
    from mcnav.workflow.export import export_run
    from mcnav.workflow.stored_summary import summary_of

_HOMES = {
    "Attitude": "mcnav.systems.closed_loop.declarations",
    "ClosedLoop": "mcnav.systems.closed_loop.declarations",
    "Correction": "mcnav.systems.closed_loop.declarations",
    "Filter": "mcnav.systems.closed_loop.declarations",
    "GaussMarkov": "mcnav.systems.closed_loop.declarations",
    "Measurement": "mcnav.systems.closed_loop.declarations",
    "Phase": "mcnav.systems.closed_loop.declarations",
    "Trigger": "mcnav.systems.closed_loop.declarations",
    "Strapdown": "mcnav.systems.closed_loop.strapdown.navigator",
    "White": "mcnav.systems.closed_loop.declarations",
    "AllocationResult": "mcnav.frames.allocation",
    "RunComparison": "mcnav.workflow.compare",
    "Campaign": "mcnav.frames.campaigns",
    "CampaignError": "mcnav.errors",
    "Epochs": "mcnav.contract.history",
    "Simulated": "mcnav.systems.user.simulated",
    "RunResult": "mcnav.frames.runs",
    "History": "mcnav.contract.history",
    "ImuLog": "mcnav.logs.imu_log",
    "IdentifiedNoise": "mcnav.identification.identify",
    "Innovations": "mcnav.systems.user.simulated",
    "Judgement": "mcnav.judgement.verdict",
    "SimulationResult": "mcnav.contract.samples",
    "LinearAnswer": "mcnav.analysis.linear_answer",
    "Output": "mcnav.contract.quantities",
    "Panel": "mcnav.contract.history",
    "RecordingFiles": "mcnav.studies.recordings",
    "RunFolderError": "mcnav.errors",
    "Source": "mcnav.contract.quantities",
    "allocate": "mcnav.frames.allocation",
    "check_scenario": "mcnav.frames.runs",
    "compare_runs": "mcnav.workflow.compare",
    "export_run": "mcnav.workflow.export",
    "run": "mcnav.frames.runs",
    "identify_noise": "mcnav.identification.identify",
    "judge_recording": "mcnav.studies.judge",
    "linear_covariance": "mcnav.studies.linear_covariance",
    "open_run": "mcnav.frames.runs",
    "read_campaign": "mcnav.frames.campaigns",
    "read_imu_log": "mcnav.logs.imu_log",
    "read_table": "mcnav.logs.tables",
    "read_track": "mcnav.logs.track",
    "report_run": "mcnav.workflow.analyse",
    "run_campaign": "mcnav.frames.runs",
    "samples_of": "mcnav.workflow.analyse",
    "summary_of": "mcnav.workflow.stored_summary",
    "sweep": "mcnav.frames.runs",
    "Track": "mcnav.logs.track",
    "Errors": "mcnav.sampler.errors",
    "CovarianceVerdict": "mcnav.frames.covariance_verdict",
    "compare": "mcnav.frames.comparison",
    "fixed": "mcnav.sampler.sizes",
    "LinearResult": "mcnav.frames.answers",
    "lincov": "mcnav.frames.answers",
    "normal": "mcnav.sampler.sizes",
    "partials": "mcnav.frames.linear",
    "propagate_covariance": "mcnav.frames.linear",
    "simulate": "mcnav.frames.simulation",
    "student_t": "mcnav.sampler.sizes",
    "table": "mcnav.sampler.sizes",
    "Tuning": "mcnav.analysis.tuning",
    "tune": "mcnav.studies.tune",
    "triangular": "mcnav.sampler.sizes",
    "truncated_normal": "mcnav.sampler.sizes",
    "uniform": "mcnav.sampler.sizes",
}

__all__ = [
    "AllocationResult",
    "Attitude",
    "Campaign",
    "CampaignError",
    "ClosedLoop",
    "Correction",
    "CovarianceVerdict",
    "Epochs",
    "Errors",
    "Filter",
    "GaussMarkov",
    "History",
    "IdentifiedNoise",
    "ImuLog",
    "Innovations",
    "Judgement",
    "LinearAnswer",
    "LinearResult",
    "Measurement",
    "Output",
    "Panel",
    "Phase",
    "RecordingFiles",
    "RunComparison",
    "RunFolderError",
    "RunResult",
    "Simulated",
    "SimulationResult",
    "Source",
    "Strapdown",
    "Track",
    "Trigger",
    "Tuning",
    "White",
    "allocate",
    "check_scenario",
    "compare",
    "compare_runs",
    "export_run",
    "fixed",
    "identify",
    "identify_noise",
    "judge",
    "judge_recording",
    "lincov",
    "linear_covariance",
    "normal",
    "open_run",
    "partials",
    "propagate_covariance",
    "read_campaign",
    "read_imu_log",
    "read_table",
    "read_track",
    "report_run",
    "run",
    "run_campaign",
    "samples_of",
    "simulate",
    "student_t",
    "summary_of",
    "sweep",
    "table",
    "triangular",
    "truncated_normal",
    "tune",
    "uniform",
]

_SHORT = {"identify": "identify_noise", "judge": "judge_recording"}
"""Names of the commands, and the functions behind them."""

_EARLIER = {"Between": "RunComparison", "Outcomes": "SimulationResult"}
"""Former names, which user-defined scenarios may still use."""

_RENAMED = {"fly": "run", "Flown": "Simulated", "FlownRun": "RunResult", "Allocation": "AllocationResult"}
"""Former names that work for one release with a warning."""


def __getattr__(name: str) -> Any:
    """Import a public name on first use, so that ``mcnav --help`` does not wait for numerical libraries."""
    if name in _RENAMED:
        from warnings import warn

        warn(f"mcnav.{name} is now mcnav.{_RENAMED[name]}", DeprecationWarning, stacklevel=2)
    name = (_EARLIER | _RENAMED).get(name, name)
    name = _SHORT.get(name, name)
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    if name.startswith("_"):
        raise AttributeError(f"module 'mcnav' has no attribute {name!r}")
    from mcnav.errors import suggestion

    raise AttributeError(f"module 'mcnav' has no attribute {name!r}{suggestion(name, __all__)}")


def __dir__() -> list[str]:
    """List the public names, and none of the modules that happen to be imported."""
    return sorted(__all__)
