"""Columns of public logs and data sets: names and units as they are published, and the channel that
a reader of them would take each for; '' for none, `?` where the name leaves something open.
"""

from __future__ import annotations

Header = dict[str, str]

WHEEL_TESTBEDS: dict[str, Header] = {
    "a rig's log in lunar simulant, C. Daca 2023": {
        "maxon_current": "current",
        "maxon_velmes": "",
        "akd_velmes": "carriage_speed",
        "sinkage": "sinkage",
    },
    "its force sensor": {
        "dp": "drawbar_pull",
        "fn": "load",
        "z": "sinkage",
        "torque": "torque?",
        "current": "current",
    },
    "a simulator's log, Project Chrono": {
        "t": "time",
        "angle": "wheel_angle",
        "x": "carriage_position",
        "z": "sinkage",
        "W": "load",
        "DP": "drawbar_pull",
        "T": "torque?",
        "omega": "",
        "v": "",
    },
    "a wheel in a DEM": {
        "time": "time",
        "wheel_obtained_lin_vel": "",
        "wheel_obtained_ang_vel": "",
        "wheel_obtained_slip_ratio": "",
        "wheel_net_torque": "torque",
        "wheel_drawbar_pull": "drawbar_pull",
    },
    "a wheel with lugs, sweep": {
        "time": "time",
        "radius": "",
        "displacement": "carriage_position",
        "drawbar_pull": "drawbar_pull",
        "normal_force": "load",
        "sinkage": "sinkage",
        "soil_Kphi": "",
    },
    "a rover wheel against slip": {
        "time": "time",
        "slip_percent": "",
        "sinkage_mm": "sinkage",
    },
    "a bevameter": {"Force (N)": "force?", "Sinkage (mm)": "sinkage"},
}

FORCE_SENSORS: dict[str, Header] = {
    "ATI Mini40": {
        "time(ms)": "time",
        "Fx(lbf)": "drawbar_pull",
        "Fy(lbf)": "lateral_force",
        "Fz(lbf)": "load",
        "Ty(lbf-in)": "torque?",
    },
    "MMS101": {
        "time_iso": "time",
        "sample_idx": "",
        "sensor_idx": "",
        "Fx": "drawbar_pull",
        "Fy": "lateral_force",
        "Fz": "load",
        "Ty": "torque?",
    },
    "Axia80": {
        "Time [ s ]": "time",
        "Fx [N]": "drawbar_pull",
        "Fz [N]": "load",
        "Ty [N-m]": "torque?",
    },
    "force plates": {
        "Time (s)": "time",
        "LeftForce (N)": "force?",
        "Velocity (m/s)": "",
        "Displacement (m)": "carriage_position",
    },
    "universal testing machine": {
        "Time (s)": "time",
        "Extension (mm)": "",
        "Load (N)": "load",
    },
    "MTS": {
        "Total Time (s)": "time",
        "Displacement(Linear|Digital Position) (mm)": "carriage_position",
        "Load(Linear|Load) (N)": "load",
    },
    "fatigue": {
        "Machine_N_cycles": "",
        "Machine_Load [kN]": "load",
        "Machine_Displacement [mm]": "carriage_position",
    },
    "treadmill": {
        "Time [s]": "time",
        "Pitch Moment [Nm]": "",
        "Belt Velocity [m/s]": "carriage_speed",
    },
    "load cell": {"t": "time", "fx": "drawbar_pull", "fx_raw": "", "fz": "load"},
}

ROBOTS: dict[str, Header] = {
    "wheeled, for identification": {
        "t": "time",
        "cmd_left": "",
        "x": "carriage_position",
        "y": "",
        "yaw": "",
        "vx": "",
        "yaw_rate": "",
    },
    "a robot's telemetry": {
        "t_ms": "time",
        "x(in)": "carriage_position",
        "y(in)": "",
        "theta(deg)": "wheel_angle",
        "v_l(ips)": "",
        "batt_V": "",
    },
    "units in brackets": {
        "t [s]": "time",
        "wheel [count]": "wheel_count?",
        "cart [counts]": "carriage_count?",
    },
    "two encoders": {"t_ms": "time", "left_encoder": "wheel_count?", "right_encoder": ""},
    "traction and steering": {
        "time": "time",
        "encoder_values": "wheel_count?",
        "angular_velocity": "",
        "steering_angle": "",
    },
    "ESC": {
        "ms_today": "time",
        "input_voltage": "",
        "temp_motor": "motor_temperature",
        "current_motor": "current",
        "erpm": "wheel_speed",
        "duty_cycle": "",
    },
    "wheels of a car": {"timestamp": "time", "rpms_fl": "wheel_speed", "rpms_fr": ""},
    "legs": {"tick": "", "FL0_torque": "torque?", "FL0_pos": "carriage_position"},
    "OBD": {
        "Timestamp": "time",
        "RPM": "wheel_speed",
        "Vehicle Speed (km/h)": "carriage_speed",
        "Engine Load (%)": "",
        "Throttle Position (%)": "",
    },
    "a dynamometer": {
        "Time (s)": "time",
        "Speed (RPM)": "wheel_speed",
        "Torque (Nm)": "torque?",
        "Current (A)": "current",
        "Voltage (V)": "",
    },
    "a test bench": {"time_s": "time", "motor_torque": "motor_torque", "throttle_pct": ""},
    "a pole on a cart": {
        "time_s": "time",
        "torque_nm": "torque?",
        "cart_vel_mps": "carriage_speed",
    },
    "a loader": {
        "boom_angle_deg": "",
        "drive_axle_speed_rps": "wheel_speed",
        "gear_index": "",
        "force_lift_MN": "force?",
    },
    "a motor drive, EMPS": {"t": "time", "qm": "", "qg": "", "vir": ""},
}

ROS: dict[str, Header] = {
    "a wrench by rostopic": {
        "field.header.seq": "",
        "field.wrench.force.x": "drawbar_pull",
        "field.wrench.force.y": "lateral_force",
        "field.wrench.force.z": "load",
        "field.wrench.torque.y": "torque",
    },
    "joints": {
        "/joint_states.position[wheel]": "wheel_angle",
        "/joint_states.effort[wheel]": "torque?",
        "/ft_sensor.wrench.force.z": "load",
        "/sinkage_mm.data": "sinkage",
    },
}

LANGUAGES: dict[str, Header] = {
    "German": {
        "Zeit [s]": "time",
        "Radwinkel [°]": "wheel_angle",
        "Schlittenweg [mm]": "carriage_position",
        "Einsinkung [mm]": "sinkage",
        "Zugkraft [N]": "drawbar_pull",
        "Normalkraft [N]": "load",
        "Drehmoment [Nm]": "torque?",
    },
    "German, a motor": {
        "Zeit [s]": "time",
        "Raddrehzahl [1/min]": "wheel_speed",
        "Motorstrom [A]": "current",
        "Geschwindigkeit [km/h]": "",
        "Bremskraft [kN]": "force?",
        "Weg [m]": "carriage_position",
    },
    "German, a testing machine": {
        "Prüfzeit [s]": "time",
        "Standardkraft [N]": "force?",
        "Standardweg [mm]": "carriage_position",
    },
    "French": {
        "temps (s)": "time",
        "vitesse roue (tr/min)": "wheel_speed",
        "déplacement chariot (mm)": "carriage_position",
        "enfoncement (mm)": "sinkage",
        "effort de traction (N)": "drawbar_pull",
        "charge verticale (N)": "load",
        "Couple (Nm)": "torque?",
        "courant": "current",
        "tension": "",
    },
    "Spanish": {
        "Tiempo (s)": "time",
        "velocidad rueda (rpm)": "wheel_speed",
        "Desplazamiento (mm)": "carriage_position",
        "hundimiento (mm)": "sinkage",
        "fuerza de tracción (N)": "drawbar_pull",
        "carga vertical (N)": "load",
        "par motor (Nm)": "motor_torque",
    },
    "Italian": {
        "tempo [s]": "time",
        "velocità ruota [rpm]": "wheel_speed",
        "spostamento carrello [mm]": "carriage_position",
        "affondamento [mm]": "sinkage",
        "Coppia [Nm]": "torque?",
        "Corrente [A]": "current",
        "carico verticale [N]": "load",
    },
    "Chinese": {
        "时间(s)": "time",
        "车轮转速(rpm)": "wheel_speed",
        "小车位移(mm)": "carriage_position",
        "沉陷量(mm)": "sinkage",
        "挂钩牵引力(N)": "drawbar_pull",
        "垂直载荷(N)": "load",
        "扭矩(Nm)": "torque?",
        "功率(kW)": "",
        "滑转率": "",
    },
    "Chinese, an electric motor": {
        "驱动电机转速": "wheel_speed",
        "驱动电机转矩": "motor_torque",
        "驱动电机温度": "motor_temperature",
    },
    "Japanese": {
        "時間[s]": "time",
        "車輪回転角[deg]": "wheel_angle",
        "台車速度[mm/s]": "carriage_speed",
        "沈下量[mm]": "sinkage",
        "けん引力[N]": "drawbar_pull",
        "垂直荷重[N]": "load",
        "トルク[Nm]": "torque?",
        "電流[mA]": "current",
    },
}
ALL = WHEEL_TESTBEDS | FORCE_SENSORS | ROBOTS | ROS | LANGUAGES
