"""Bring-up of a board, stage by stage: what works, what does not, and why."""

from rtl_model.bringup.bench import Bench, Burst
from rtl_model.bringup.closed_form import spikes_of
from rtl_model.bringup.deadline import DeadlinePort, OutOfTime
from rtl_model.bringup.junit import junit_xml, write_junit
from rtl_model.bringup.prbs_stage import check_prbs, which_bits
from rtl_model.bringup.run import bring_up
from rtl_model.bringup.stage import STAGES, Report, Stage, StageFault
from rtl_model.bringup.wrong_bits import WrongBits, compare

__all__ = [
    "STAGES",
    "Bench",
    "Burst",
    "DeadlinePort",
    "OutOfTime",
    "Report",
    "Stage",
    "StageFault",
    "WrongBits",
    "bring_up",
    "check_prbs",
    "compare",
    "junit_xml",
    "spikes_of",
    "which_bits",
    "write_junit",
]
