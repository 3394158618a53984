# The interpreter's end of the plugin `python`: loads a file and answers questions about its contacts.
#
# A question has 20 doubles, little-endian: kind (0 contacts, 1 reset), position (3), quaternion xyzw (4), velocity (3), angular velocity
# (3), time (s), time step (s), values (4). An answer has 5 doubles: number of contacts, 1 with a field, valid_m, valid_rad, valid_s; then
# 17 for each contact, then 42 of the field. A number of contacts of -1: the second double is the length of the text that follows.
import importlib.util
import math
import os
import signal
import struct
import sys
import threading
import time
import traceback
import types
from typing import NamedTuple


class Handle(NamedTuple):
    """Handle at which the contacts are asked for: SI units, model frame."""

    position_m: tuple
    orientation_xyzw: tuple
    linear_m_per_s: tuple
    angular_rad_per_s: tuple
    time_s: float
    dt_s: float  #: time since the last call
    values: tuple  #: live parameters value_1 to value_4


class Contact(NamedTuple):
    """Contact of a point of the tool with the plane of a surface nearby; it only pushes."""

    normal: tuple  #: unit normal of the surface, towards the tool
    gap_m: float  #: distance from the surface along the normal; below 0 inside
    stiffness_n_per_m: float
    damping_ns_per_m: float = 0.0
    friction: float = 0.0
    tangential_stiffness_n_per_m: float = None  #: while it sticks; with friction that of the normal
    surface_velocity_m_per_s: tuple = (0.0, 0.0, 0.0)
    tool_point_m: tuple = (0.0, 0.0, 0.0)  #: relative to the handle, in its orientation
    surface_point_m: tuple = None  #: closest point of the surface; by default along the normal


class Field(NamedTuple):
    """Wrench at the handle and its change nearby, for a force that also pulls: W - K d."""

    force_n: tuple = (0.0, 0.0, 0.0)
    torque_nm: tuple = (0.0, 0.0, 0.0)
    stiffness: tuple = ((0.0,) * 6,) * 6  #: 6 x 6, rows force and torque, columns translation (m) and rotation (rad)


class Answer(NamedTuple):
    """Contacts and field, with the distances from the handle and the age for which they are valid."""

    contacts: tuple = ()
    field: Field = None
    valid_m: float = math.inf
    valid_rad: float = math.inf
    valid_s: float = 0.0  #: 0: three periods of the model


def rotated(quaternion, vector):
    """Rotates a vector by a unit quaternion."""
    x, y, z, w = quaternion
    a, b, c = vector
    u, v, t = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return a + w * u + y * t - z * v, b + w * v + z * u - x * t, c + w * t + x * v - y * u


def numbers(contact, handle):
    surface = contact.surface_point_m
    if surface is None:
        arm = rotated(handle.orientation_xyzw, contact.tool_point_m)
        surface = [p + a - n * contact.gap_m for p, a, n in zip(handle.position_m, arm, contact.normal)]
    across = contact.tangential_stiffness_n_per_m
    if across is None:
        across = contact.stiffness_n_per_m if contact.friction else 0.0
    return [*contact.tool_point_m, *surface, *contact.normal, contact.gap_m, *contact.surface_velocity_m_per_s,
            contact.stiffness_n_per_m, across, contact.damping_ns_per_m, contact.friction]


def packed(answer, handle):
    """Returns the bytes of what a function has answered: contacts, a field, or both."""
    if answer is None:
        answer = ()
    if isinstance(answer, Field):
        answer = Answer(field=answer)
    if isinstance(answer, Contact) or not isinstance(answer, Answer):
        answer = Answer(contacts=(answer,) if isinstance(answer, Contact) else tuple(answer))
    contacts = answer.contacts
    if len(contacts) > 16:
        contacts = sorted(contacts, key=lambda contact: contact.gap_m)[:16]
    rows = [len(contacts), answer.field is not None, answer.valid_m, answer.valid_rad, answer.valid_s]
    for contact in contacts:
        rows += numbers(contact, handle)
    if answer.field is not None:
        rows += [*answer.field.force_n, *answer.field.torque_nm, *(k for row in answer.field.stiffness for k in row)]
    return struct.pack(f"<{len(rows)}d", *rows)


def failed():
    """Shows an exception and returns its last line as an answer."""
    traceback.print_exc()
    text = traceback.format_exception_only(*sys.exc_info()[:2])[-1].strip().encode()[:60000]
    return struct.pack("<5d", -1, len(text), 0, 0, 0) + text


def load(path, argument):
    module = types.ModuleType("flotor_model")
    module.Handle, module.Contact, module.Field, module.Answer = Handle, Contact, Field, Answer
    module.rotated = rotated
    sys.modules["flotor_model"] = module
    sys.path.insert(0, os.path.dirname(path))
    specification = importlib.util.spec_from_file_location("__flotor_file__", path)
    loaded = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(loaded)
    if hasattr(loaded, "create"):
        loaded.create(argument)
    if not hasattr(loaded, "contacts"):
        raise AttributeError("the file has no function `contacts(handle)`")
    return loaded


def end_with_host(host):
    """Ends this process when the host has ended: a function that hangs reads no end of the questions."""
    while os.getppid() == host:
        time.sleep(0.2)
    os._exit(1)


def main():
    threading.Thread(target=end_with_host, args=(os.getppid(),), daemon=True).start()
    # Ctrl-C in a terminal is for the host, which ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The pipes are for questions and answers only: what the file prints goes to the standard error, and it reads nothing.
    questions, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull) as nothing:
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)

    def send(answer):
        answers.write(answer)
        answers.flush()

    _, path, argument = sys.argv
    sys.argv = [path]
    try:
        model = load(path, argument)
    except BaseException:  # also `sys.exit` in the file
        send(failed())
        return
    send(packed((), None))
    # Without a question the host has ended.
    while len(question := questions.read(20 * 8)) == 20 * 8:
        kind, *rest = struct.unpack("<20d", question)
        handle = Handle(tuple(rest[:3]), tuple(rest[3:7]), tuple(rest[7:10]), tuple(rest[10:13]), rest[13], rest[14], tuple(rest[15:]))
        try:
            if kind == 1:
                answer = packed((), handle)
                if hasattr(model, "reset"):
                    model.reset()
            else:
                answer = packed(model.contacts(handle), handle)
        except Exception:
            answer = failed()
        send(answer)


main()
