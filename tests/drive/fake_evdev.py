"""The parts of the package evdev that forces need, for machines without it: the kernel's structures and numbers."""

import ctypes
from types import SimpleNamespace

_U16, _S16 = ctypes.c_uint16, ctypes.c_int16


def _structure(name, **fields):
    return type(name, (ctypes.Structure,), {"_fields_": list(fields.items())})


_Trigger = _structure("Trigger", button=_U16, interval=_U16)
_Replay = _structure("Replay", length=_U16, delay=_U16)
_Envelope = _structure("Envelope", attack_length=_U16, attack_level=_U16, fade_length=_U16, fade_level=_U16)
_Constant = _structure("Constant", level=_S16, ff_envelope=_Envelope)
_Condition = _structure(
    "Condition",
    **{"right_saturation": _U16, "left_saturation": _U16, "right_coeff": _S16, "left_coeff": _S16},
    **{"deadband": _U16, "center": _S16},
)
_EffectType = type(
    "EffectType",
    (ctypes.Union,),
    {"_fields_": [("ff_constant_effect", _Constant), ("ff_condition_effect", _Condition * 2)]},
)
_Effect = _structure(
    "Effect",
    **{"type": _U16, "id": _S16, "direction": _U16, "ff_trigger": _Trigger, "ff_replay": _Replay, "u": _EffectType},
)

ff = SimpleNamespace(
    **{"Trigger": _Trigger, "Replay": _Replay, "Envelope": _Envelope, "Constant": _Constant},
    **{"Condition": _Condition, "EffectType": _EffectType, "Effect": _Effect},
)
ecodes = SimpleNamespace(EV_FF=0x15, FF_RUMBLE=0x50, FF_CONSTANT=0x52, FF_SPRING=0x53)
