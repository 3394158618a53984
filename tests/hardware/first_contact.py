#!/usr/bin/env python3
"""First contact with the controller of a Maglev 200: step by step, with the force limited, into a report.

    python3 tests/hardware/first_contact.py ADDRESS [--port 5678] [--out report.toml] [--force-limit 2] [--yes]

Python 3.8 and nothing else. Each step says what will move and waits for Enter (--yes: it does not). Ctrl-C lands. No force
beyond the weight exceeds the limit. The questions are those of the book's chapter on the Maglev 200; its file answers each
with what was seen, and ends with the parameters for a scene. Try it first: flotor emulate maglev --protocol ml-api.
"""

import argparse
import socket
import struct
import sys
import threading
import time

# Functions and events of the ML API 1.5b.
CONNECT_TIMEOUT_S, CALL_TIMEOUT_S, PROCEDURE_TIMEOUT_S = 5.0, 2.0, 60.0
FIND_GRAVITY, GET_POSITION, GET_BOUNDARY, GET_CURRENT_LIMITS, GET_FAULT, GET_FORCES = 4, 5, 7, 10, 14, 16
GET_FRAME, GET_GAINS, GET_GRASP_GAINS, GET_FREQUENCY, GET_SPEED_LIMITS, GET_TEMPERATURES = 17, 18, 20, 28, 29, 30
GET_VELOCITY, GET_VERSION, LAND, REGISTER_TICK, RESET_FAULT, SET_BOUNDARY = 31, 32, 33, 40, 41, 44
SET_DESIRED, SET_FORCES, SET_GAINS, SET_GRAVITY, SET_FREQUENCY, TAKE_OFF = 47, 49, 51, 57, 59, 63
UNREGISTER_TICK, STOP_CALLBACKS, REQUEST_TOKEN, MAP_TOKEN, DISCONNECT, DEFY_GRAVITY = 69, 71, 72, 73, 3, 2
EVENT_END, EVENT_TICK = 71, 78
SETS = ("normal", "locked", "constrained", "boundary")


class Connection:
    """One connection: a frame out, a frame in."""

    def __init__(self, address, port):
        self.socket = socket.create_connection((address, port), CONNECT_TIMEOUT_S)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, code, arguments=b""):
        self.socket.sendall(struct.pack("<ii", 8 + len(arguments), code) + arguments)

    def receive(self, timeout_s):
        self.socket.settimeout(timeout_s)
        (length,) = struct.unpack("<i", self._exactly(4))
        if not 8 <= length <= 512:
            raise ValueError(f"a frame of {length} bytes")
        frame = self._exactly(length - 4)
        return struct.unpack("<i", frame[:4])[0], frame[4:]

    def _exactly(self, count):
        taken = b""
        while len(taken) < count:
            more = self.socket.recv(count - len(taken))
            if not more:
                raise ConnectionError("the controller closed the connection")
            taken += more
        return taken

    def call(self, function, arguments=b"", timeout_s=CALL_TIMEOUT_S):
        """Status and results."""
        self.send(function, arguments)
        return self.receive(timeout_s)

    def floats(self, function, arguments=b""):
        status, results = self.call(function, arguments)
        values = struct.unpack(f"<{len(results) // 4}f", results[: len(results) // 4 * 4])
        return status, [round(value, 6) for value in values]

    def pose(self):
        status, results = self.call(GET_POSITION)
        out, *at = struct.unpack("<i6f", results[:28])
        return status, out, at

    def close(self):
        self.socket.close()

    def reset(self):
        """Gone without a word, as a program that dies."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()


class Report:
    """Answers by question; written after each, so that an abort loses nothing."""

    def __init__(self, path):
        self.path, self.answers, self.parameters = path, {}, {}

    def say(self, question, **answers):
        self.answers.setdefault(question, {}).update(answers)
        print("  " + ", ".join(f"{key} = {value}" for key, value in answers.items()))
        self.write()

    def write(self):
        with open(self.path, "w", encoding="utf-8") as file:
            file.write("# First contact with a Maglev 200\n")
            for question, answers in [*self.answers.items(), ("device.parameters", self.parameters)]:
                file.write(f"\n[{question}]\n")
                for key, value in answers.items():
                    file.write(f"{key} = {toml(value)}\n")


def toml(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml(one) for one in value) + "]"
    if isinstance(value, (int, float)):
        return repr(value)
    return '"' + str(value).replace("\\", "\\\\").replace('"', '\\"') + '"'


class Laboratory:
    """The steps, in the order in which they need one another."""

    def __init__(self, options):
        self.options, self.report = options, Report(options.out)
        self.control = Connection(options.address, options.port)
        self.gravity, self.gains = [0.0] * 6, {}

    def another(self):
        return Connection(self.options.address, self.options.port)

    def ask(self, what):
        print(f"\n{what}")
        if not self.options.yes:
            input("  Enter goes on, Ctrl-C lands and ends: ")

    def run(self):
        steps = [
            self.looks, self.statuses_while_landed, self.takes_off, self.weighs, self.moves_by_forces, self.ticks,
            self.second_client, self.lands_without_gains, self.vanishes,
        ]
        try:
            for step in steps[: self.options.steps]:
                step()
        finally:
            self.lands()
            self.report.write()
            print(f"\nThe answers are in {self.options.out}; please attach the file to an issue of Flotor.")

    def looks(self):
        self.ask("1. Reading only: nothing moves.")
        report, control = self.report, self.control
        status, version = control.call(GET_VERSION)
        report.say("identity", version=version.split(b"\0")[0].decode("ascii", "replace"), version_bytes=version.hex(), status=status)
        for number, name in enumerate(SETS):
            status, gains = control.floats(GET_GAINS, struct.pack("<i", number))
            self.gains[number] = gains
            report.say("gains", **{name: gains})
        for name, function in [
            ("current_limits_a", GET_CURRENT_LIMITS), ("speed_limits", GET_SPEED_LIMITS), ("temperatures_c", GET_TEMPERATURES),
            ("boundary_m", GET_BOUNDARY), ("servo_hz", GET_FREQUENCY), ("velocity", GET_VELOCITY), ("forces", GET_FORCES),
        ]:
            status, values = control.floats(function)
            report.say("limits", **{name: values, f"{name}_status": status})
        status, out, at = control.pose()
        report.say("landed_pose", out_of_range=bool(out), at=at, status=status)
        for name, function in [("frame", GET_FRAME), ("grasp_gains", GET_GRASP_GAINS)]:
            report.say("not_yet_implemented", **{f"{name}_status": control.call(function)[0]})
        times = sorted(self.timed_call() for _ in range(1000))
        report.say("call_us", median=round(times[500] * 1e6), p99=round(times[990] * 1e6))

    def timed_call(self):
        began = time.perf_counter()
        self.control.call(GET_FAULT)
        return time.perf_counter() - began

    def statuses_while_landed(self):
        self.ask("2. Commands that make no sense while landed: nothing should move; keep a hand at the power switch.")
        call = self.control.call
        self.report.say("statuses", land_while_landed=call(LAND, timeout_s=PROCEDURE_TIMEOUT_S)[0])
        self.report.say("statuses", find_gravity_while_landed=call(FIND_GRAVITY, timeout_s=PROCEDURE_TIMEOUT_S)[0])
        self.report.say("statuses", zero_forces_while_landed=call(SET_FORCES, bytes(24))[0])
        # On a connection of its own: a controller may drop it.
        for name, function in [("function_0", 0), ("function_6", 6), ("function_99", 99)]:
            stranger = self.another()
            try:
                status, results = stranger.call(function)
                self.report.say("statuses", **{name: status, f"{name}_bytes": len(results)})
            except (OSError, ValueError) as error:
                self.report.say("statuses", **{name: f"{type(error).__name__}"})
            stranger.close()
        for hertz in (99.0, 10001.0):
            self.report.say("statuses", **{f"frequency_{hertz:.0f}": call(SET_FREQUENCY, struct.pack("<f", hertz))[0]})
        call(SET_FREQUENCY, struct.pack("<f", 1000.0))

    def takes_off(self):
        self.ask("3. TAKE-OFF. Hold the handle loosely inside its range.")
        for _ in range(20):
            status, _ = self.control.call(RESET_FAULT)
            (fault,) = struct.unpack("<I", self.control.call(GET_FAULT)[1][:4])
            self.report.say("faults", reset_status=status, left=fault)
            if fault == 0:
                break
            takeoff = self.control.call(TAKE_OFF, timeout_s=PROCEDURE_TIMEOUT_S)[0]
            self.report.say("statuses", take_off_in_a_fault=takeoff)
            time.sleep(0.5)
        else:
            raise SystemExit(f"the controller stays faulted (faults {fault:#x}); end their cause, and start again")
        began = time.monotonic()
        status, _ = self.control.call(TAKE_OFF, timeout_s=PROCEDURE_TIMEOUT_S)
        self.report.say("take_off", status=status, seconds=round(time.monotonic() - began, 2), at=self.control.pose()[2])
        self.report.say("take_off", again_status=self.control.call(TAKE_OFF, timeout_s=PROCEDURE_TIMEOUT_S)[0])
        self.gains[0] = self.control.floats(GET_GAINS, struct.pack("<i", 0))[1]
        self.report.say("take_off", normal_gains=self.gains[0])
        self.control.call(SET_BOUNDARY, struct.pack("<f", 0.011))
        self.report.parameters.update(boundary_mm=11.0)

    def weighs(self):
        self.ask("4. FIND GRAVITY. Let the handle go: it floats by itself.")
        began = time.monotonic()
        status, results = self.control.call(FIND_GRAVITY, timeout_s=PROCEDURE_TIMEOUT_S)
        self.gravity = list(struct.unpack("<6f", results[:24]))
        self.report.say("gravity", status=status, seconds=round(time.monotonic() - began, 2), wrench=self.gravity)
        if not 1.0 < self.gravity[2] < 20.0:
            raise SystemExit(f"the measured weight, {self.gravity[2]:.2f} N, is not that of a flotor (1 N to 20 N); start again, and touch nothing in step 4")
        self.control.call(SET_GRAVITY, struct.pack("<6f", *self.gravity))
        self.report.say("gravity", defy_status=self.control.call(DEFY_GRAVITY)[0])

    def forces(self, extra_n):
        extra_n = max(-self.options.force_limit, min(self.options.force_limit, extra_n))
        wrench = [*self.gravity[:2], self.gravity[2] + extra_n, *self.gravity[3:]]
        return self.control.call(SET_FORCES, struct.pack("<6f", *wrench))[0]

    def moves_by_forces(self):
        self.ask("5. FORCES. Let the handle go. It may rise by some millimetres for a second.")
        # With the default gains on: replaced gains let it rise until the boundary, gains on top hold it within a tenth of a
        # millimetre. The force is the weight and a little more; the position says which.
        status = self.forces(0.1)
        time.sleep(0.25)
        z_m = self.control.pose()[2][2]
        self.holds()
        replaces = z_m > 1.0e-3
        forces = self.control.floats(GET_FORCES)[1]
        self.report.say("set_forces", status=status, z_after_quarter_second_m=z_m, replaces_the_gains=replaces, held_by=forces)
        # What replaces the gains needs no fading of them.
        self.report.parameters.update(fade_ms=0.0 if replaces else 1000.0)

    def holds(self):
        """By the gains, at home."""
        self.control.call(SET_DESIRED, bytes(28))

    def ticks(self):
        self.ask("6. TICKS at 1000 Hz and more, three seconds each. The flotor holds still.")
        best_hz = 0.0
        for hertz in (1000.0, 1500.0, 2000.0, 4000.0):
            status = self.control.call(SET_FREQUENCY, struct.pack("<f", hertz))[0]
            count, gap_s, _ = self.listens(3.0, 0.0)
            self.report.say("ticks", **{f"at_{hertz:.0f}_hz": round(count / 3.0, 1), f"longest_gap_at_{hertz:.0f}_hz_ms": round(gap_s * 1e3, 2), f"status_{hertz:.0f}": status})
            if count / 3.0 > 0.99 * hertz:
                best_hz = hertz
        self.control.call(SET_FREQUENCY, struct.pack("<f", 1000.0))
        # A client that takes 20 ms for each tick: as many as it acknowledges, or all of them, later and later.
        count, _, spread = self.listens(2.0, 0.02)
        self.report.say("ticks", largest_rate_hz=best_hz, with_20_ms_handler=count, waits_for_acknowledgements=not spread)

    def listens(self, seconds, handler_s):
        """Ticks that came, the longest gap, and whether one was waiting when the one before was acknowledged."""
        events = self.another()
        token = events.call(REQUEST_TOKEN)[1]
        self.control.call(MAP_TOKEN, token[:4])
        state = {"count": 0, "gap": 0.0, "queued": 0}

        def handle():
            last = None
            while True:
                try:
                    event, _ = events.receive(5.0)
                except (OSError, ValueError):
                    return
                now = time.perf_counter()
                if event == EVENT_END:
                    events.send(-1)
                    return
                if event == EVENT_TICK:
                    state["gap"] = max(state["gap"], now - last if last else 0.0)
                    last = now
                    state["count"] += 1
                    time.sleep(handler_s)
                    events.socket.settimeout(0.0)
                    try:
                        state["queued"] += len(events.socket.recv(64, socket.MSG_PEEK)) > 0
                    except BlockingIOError:
                        pass
                events.socket.settimeout(5.0)
                events.send(0)

        thread = threading.Thread(target=handle, daemon=True)
        thread.start()
        self.control.call(REGISTER_TICK, struct.pack("<i", 4242))
        time.sleep(seconds)
        self.control.call(UNREGISTER_TICK, struct.pack("<i", 4242))
        self.control.call(STOP_CALLBACKS)
        thread.join(30.0)
        events.close()
        return state["count"], state["gap"], state["queued"] > 0

    def second_client(self):
        self.ask("7. A SECOND CLIENT reads and commands; the flotor holds still.")
        other = self.another()
        reads = other.pose()[0]
        commands, _ = other.call(SET_DESIRED, bytes(28))
        other.call(DISCONNECT)
        other.close()
        self.report.say("second_client", reading_status=reads, commanding_status=commands)

    def lands_without_gains(self):
        self.ask("8. LAND WITHOUT GAINS. Put a soft cloth below: the flotor may fall by a centimetre.")
        self.forces(0.0)
        for number in (0, 1, 2):
            self.control.call(SET_GAINS, struct.pack("<i", number) + bytes(96))
        stop = self.another()
        began, poses = time.monotonic(), []
        stop.send(LAND)
        while time.monotonic() - began < 4.0:
            poses.append(self.control.pose()[2][2])
            time.sleep(0.005)
        fastest = max((a - b) / 0.005 for a, b in zip(poses, poses[1:]))
        try:
            status = stop.receive(PROCEDURE_TIMEOUT_S)[0]
        except OSError as error:
            status = type(error).__name__
        stop.close()
        self.report.say("land_without_gains", status=status, fastest_m_per_s=round(fastest, 3), ends_at_m=poses[-1], is_gentle=fastest < 0.1)
        for number in (0, 1, 2):
            self.control.call(SET_GAINS, struct.pack("<i", number) + struct.pack("<24f", *self.gains[number]))

    def vanishes(self):
        self.ask("9. A CLIENT VANISHES in the air. Keep the cloth; the flotor may stay, land or fall.")
        self.control.call(TAKE_OFF, timeout_s=PROCEDURE_TIMEOUT_S)
        self.control.reset()
        time.sleep(0.2)
        self.control = self.another()
        heights = []
        for _ in range(30):
            heights.append(round(self.control.pose()[2][2], 5))
            time.sleep(0.1)
        self.report.say("vanished_client", heights_m=heights, lands=heights[-1] < -5.0e-3)

    def lands(self):
        try:
            self.control.call(LAND, timeout_s=PROCEDURE_TIMEOUT_S)
            self.control.call(DISCONNECT)
        except (OSError, ValueError):
            # A reply was on its way: the same on a new connection.
            with_luck = self.another()
            with_luck.call(LAND, timeout_s=PROCEDURE_TIMEOUT_S)
            with_luck.close()
        self.control.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("address", help="address or host name of the controller")
    parser.add_argument("--port", type=int, default=5678, help="TCP port of the controller (default: %(default)s)")
    parser.add_argument("--out", default="first-contact.toml", help="file for the results, which is overwritten (default: %(default)s)")
    parser.add_argument("--force-limit", type=float, default=2.0, help="largest force beyond the weight, N, from 0 to 5 (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=9, help="number of steps to execute, from 1 to 9 (default: %(default)s)")
    parser.add_argument("--yes", action="store_true", help="do not wait for Enter before each step")
    options = parser.parse_args()
    options.force_limit = max(0.0, min(5.0, options.force_limit))
    try:
        Laboratory(options).run()
    except KeyboardInterrupt:
        sys.exit("ended by the user; landed")


if __name__ == "__main__":
    main()
