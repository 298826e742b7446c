"""Messages of Haply's published pages, as facts of the protocol: docs.haply.co, Inverse SDK."""

INVENTORY_35 = """
{"session_id": 7, "inverse3": [{
 "device_id": "049D",
 "config": {
  "type": "inverse3", "port": "COM12",
  "device_info": {"major_version": 7, "minor_version": 4, "id": "049D", "device_type": 4,
   "uuid": "5A9F3AC02E085C078AD6A4A113DE049D"},
  "extended_device_id": "5A9F3AC02E085C078AD6A4A113DE049D",
  "extended_firmware_version": "77488E4644C",
  "gravity_compensation": {"enabled": true, "scaling_factor": 1.0},
  "handedness": "right", "streaming_mode": "USB", "torque_scaling": {"enabled": true},
  "home_return": {"enabled": false}, "preset": "defaults", "basis": {"permutation": "XYZ"},
  "mount": {"position": {"x": 0, "y": 0, "z": 0}, "rotation": {"w": 1, "x": 0, "y": 0, "z": 0},
   "scale": {"x": 1, "y": 1, "z": 1}},
  "filters": {"force_gate": {"gain": 0.3}, "damping": {"scalar": 0.0}}},
 "state": {
  "cursor_position": {"x": 0.0, "y": -0.12, "z": 0.15},
  "cursor_velocity": {"x": 0.0, "y": 0.0, "z": 0.0},
  "angular_position": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
  "angular_velocity": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
  "body_orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
  "current_cursor_force": {"x": 0.0, "y": 0.0, "z": 0.0},
  "current_cursor_position": {"x": 0.0, "y": 0.0, "z": 0.0},
  "current_angular_torques": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
  "current_angular_position": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
  "control_domain": "cartesian", "control_mode": "idle",
  "transform": {"position": {"x": 0, "y": 0, "z": 0}, "rotation": {"w": 1, "x": 0, "y": 0, "z": 0},
   "scale": {"x": 1, "y": 1, "z": 1}}},
 "status": {"calibrated": true, "in_use": false, "power_supply": true, "ready": true,
  "started": true}}],
 "wireless_verse_grip": []}
"""
"""*WebSocket Protocol* of 3.5, step 1."""

INVENTORY_31 = """
{"inverse3": [{
 "device_id": "04BA",
 "config": {
  "type": "inverse3", "port": "COM13",
  "device_info": {"major_version": 7, "minor_version": 1, "id": "04BA", "model": 4,
   "uuid": "2D35F80DD9005F599B68F49944CB04BA"},
  "extended_device_id": "2D35F80DD9005F599B68F49944CB04BA",
  "extended_firmware_version": "8C20FDC8010AA1E15AA133CDA2534874",
  "gravity_compensation": {"enabled": true, "scaling_factor": 1}, "handedness": "right",
  "torque_scaling": {"enabled": true}},
 "state": {
  "cursor_position": {"x": 0.07842738, "y": -0.14836666, "z": 0.14297646},
  "cursor_velocity": {"x": -0.011969013, "y": 0.0012009288, "z": -0.043197},
  "angular_position": {"a0": -69.31704, "a1": 137.62952, "a2": 19.832787},
  "angular_velocity": {"a0": 0, "a1": 0, "a2": 0},
  "body_orientation": {"w": 0.7113037, "x": -0.01940918, "y": 0.7026367, "z": 0.00048828125},
  "mode": "idle"},
 "status": {"calibrated": false, "in_use": false, "power_supply": true, "ready": true,
  "started": true}}],
 "wireless_verse_grip": []}
"""
"""*Simulation Channel* of 3.4, format 3.1, its members in our order."""

FORCE_31 = (
    b'{"inverse3":[{"device_id":"049D","commands":{"set_cursor_force":'
    b'{"values":{"x":0.0,"y":3.0,"z":3.0}}}}]}'
)
FORCE_35 = (
    b'{"inverse3":[{"device_id":"049D","commands":{"set_cursor_force":'
    b'{"vector":{"x":0.0,"y":0.0,"z":1.5}}}}]}'
)
"""*Control Commands* of 3.5: one force, without blanks."""
PROFILE_35 = (
    b'{"session":{"configure":{"profile":{"name":"co.haply.inverse.tutorials:print-inverse3"}}},'
    b'"inverse3":[{"device_id":"049D","commands":{"set_cursor_force":'
    b'{"vector":{"x":0.0,"y":0.0,"z":0.0}}}}]}'
)
"""*Tutorial 01*: the first message of a session."""
PLACE_35 = (
    b'{"inverse3":[{"device_id":"049D","commands":{"set_cursor_position":'
    b'{"position":{"x":0.0,"y":-0.12,"z":0.15}}}}]}'
)
"""*Control Commands* of 3.5: one place, without blanks."""
QUICK_35 = (
    b'{"inverse3": [{"device_id": "049D", "commands": {"set_cursor_force": '
    b'{"vector": {"x": 0, "y": 0, "z": 0}}}}]}'
)
"""The *Quick Example* of the SDK's first page, 3.5, as Python writes it."""
OTHERS_35 = (
    b'{"inverse3":[{"device_id":"049D","commands":{"set_angular_torques":'
    b'{"torques":{"a0":0.0,"a1":0.0,"a2":0.0}}}}]}',
    b'{"inverse3":[{"device_id":"049D","commands":{"set_angular_position":'
    b'{"angles":{"a0":30.0,"a1":45.0,"a2":60.0}}}}]}',
    b'{"inverse3":[{"device_id":"049D","commands":{"probe_position":{}}}]}',
)
"""*Control Commands* and *Simulation Channel* of 3.5: what moves no simulated cursor."""
WIRED_GRIP = """
{"device_id": "61548", "config": {"port": "COM3", "type": "verse_grip"},
 "state": {"button": false, "hall": 0, "orientation":
  {"x": -0.5019531, "y": 0.8632202, "z": -0.048095703, "w": -0.022338867}},
 "status": {"error": 0, "ready": true}}
"""
"""*HTTP* of 3.4: a member of `verse_grip`."""
