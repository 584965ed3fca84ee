"""Options of `viform board` that have no effect together are refused before anything is opened."""

import pytest

UDP = ("--port", "udp:127.0.0.1:9")


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (("identify", *UDP, "--baud", 115_200), "--baud must be given with a serial port"),
        (("bringup", *UDP, "--baud", 9600), "--baud must be given with a serial port"),
        (("bringup", *UDP, "--low-latency"), "--low-latency must be given with a serial port"),
        (("identify", *UDP, "--dtr", "off"), "--dtr and --rts must be given with a serial port"),
        (("prbs", "--rts", "low"), "--rts must be one of 'on', 'off', not 'low'"),
        (
            ("gateware", "ulx3s-25f", "--ethernet", "rmii", "--baud", 9600, "--out", "x"),
            "--baud must be left out with --ethernet",
        ),
        (("virtual", "--udp", "127.0.0.1", "--baud", 9600), "--baud must be left out with --udp"),
        (("regs", "--list", "--set", "sensor_run=1"), "--set and the options of the line must be"),
        (("regs", "--list", *UDP), "--set and the options of the line must be left out"),
        (("replay", "none.jsonl", "--frames", 3), "--frames must be given with --bringup"),
        (("compare", "--lockstep", "--frames", 3), "--frames, --levels, --set and the options of"),
        (("compare", "--lockstep", "--levels", 16), "--frames, --levels, --set and the options of"),
        (("compare", "--lockstep", "--baud", 9600), "--frames, --levels, --set and the options of"),
        (("compare", "--rows", 8), "--rows, --columns, --lanes, --seed, --pixels, --until, "),
    ],
)
def test_an_option_without_effect_is_refused(refused, tmp_path, monkeypatch, command, says):
    monkeypatch.chdir(tmp_path)
    assert says in refused("board", *command)
    assert not list(tmp_path.iterdir())
