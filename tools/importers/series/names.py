"""What columns of time series are called, and how their units are written, in seven languages.

A further word is one more entry: `word` is a whole word of a name, `word~` and `~word` begin or end
one (German and Dutch join words), and words in Chinese characters or kana stand anywhere. Accents
and capitals do not matter.
"""

from __future__ import annotations

import re
import unicodedata
from functools import lru_cache

# what a word means -> the words: English, German, French, Spanish, Italian; Chinese, Japanese
WORDS: dict[str, str] = {
    "time": (
        "time t timestamp stamp clock seconds sec secs elapsed datetime millis micros"
        " zeit zeit~ ~zeit zeitstempel uhrzeit temps horodatage heure tiempo hora tempo ora istante"
        " 时间 時間 时刻 時刻 時 经过"
    ),
    "date": "date day datum ~datum tag jour fecha dia giorno 日期 日付 年月日",
    "number": (
        "index idx number no nr num seq sequence frame row sample samples id step iteration"
        " nummer zeile ~nummer numero ligne fila riga campione 序号 编号 番号 サンプル"
    ),
    "run": (
        "run trial test experiment case versuch ~versuch lauf essai ensayo prueba prova"
        " 试验 实验 試験 実験"
    ),
    "wheel": (
        "wheel wheels rim tire tyre drum rad rad~ ~rad reifen~ felge~ umfang~ roue jante rueda"
        " llanta"
        " ruota cerchio 车轮 車輪 轮 輪 ホイール タイヤ"
    ),
    "carriage": (
        "carriage cart trolley sled slide gantry rail body chassis linear forward travel traverse"
        " belt"
        " schlitten schlitten~ ~schlitten wagen wagen~ vorschub vorschub~ vortrieb~ fahr~ bahn~"
        " chariot avance carro carrito avance carrello slitta avanzamento"
        " 小车 台车 滑台 拖车 台車 キャリッジ 走行"
    ),
    "speed": (
        "speed velocity vel rate velmes geschwindigkeit geschwindigkeit~ ~geschwindigkeit vitesse"
        " velocidad velocita 速度 车速 車速 速さ"
    ),
    "turning": (
        "rpm rpms omega ω rps erpm angular rotation rotational drehzahl drehzahl~ ~drehzahl"
        " winkelgeschwindigkeit ~winkelgeschwindigkeit regime rotativa giri"
        " 转速 轉速 角速度 回転数 回転速度"
    ),
    "angle": ("angle theta θ rot winkel winkel~ ~winkel angolo angulo 角度 转角 角位移 回転角"),
    "position": (
        "position pos distance displacement disp odometer stroke way weg ~weg strecke ~strecke"
        " ~position deplacement course desplazamiento distancia posicion recorrido spostamento"
        " distanza posizione corsa 位移 位置 距离 行程 変位 距離 移動"
    ),
    "counts": (
        "count counts tick ticks encoder enc pulses impulse ~impulse zaehler zahler ~zahler codeur"
        " impulsions pulsos impulsi 脉冲 编码器 パルス エンコーダ"
    ),
    "torque": (
        "torque moment trq tau drehmoment ~drehmoment drehmoment~ ~moment couple par momento coppia"
        " mx my mz tx ty tz 扭矩 转矩 力矩 トルク"
    ),
    "motor": (
        "motor motors maxon drive engine actuator motor~ ~motor antrieb antrieb~ antriebs~ moteur"
        " moteurs motore 电机 马达 电动机 驱动 モータ 電動機"
    ),
    "axle": (
        "axle shaft hub ft wrench sensor cell achse achs~ welle wellen~ naben~ arbre essieu eje"
        " asse"
        " 轴 軸"
    ),
    "current": (
        "current amps amp ampere amperes curr i strom ~strom strom~ courant intensite corriente"
        " intensidad corrente 电流 電流"
    ),
    "sinkage": (
        "sinkage sink z depth penetration einsinkung einsink~ ~einsinkung tiefe ~tiefe eindring~"
        " enfoncement profondeur hundimiento profundidad affondamento sprofondamento profondita"
        " 沉陷 下陷 沉降 深度 沈下 沈み 貫入 深さ"
    ),
    "height": (
        "height laser lidar sonar range hohe ~hohe abstand abstand~ ~abstand hauteur altura altezza"
        " 高さ 高度"
    ),
    "load": (
        "load fz fn normal vertical weight weights w last"
        " ~last radlast normalkraft aufstands~ auflast"
        " vertikal~ gewicht gewichts~ charge normale verticale poids carga peso carico verticale"
        " 载荷 负载 负荷 法向 垂直 竖直 荷重 鉛直 輪荷重"
    ),
    "pull": (
        "drawbar dp dbp pull fx thrust traction tractive zugkraft ~zugkraft zughaken~ zug"
        " traccion tiro trazione traino 牵引 挂钩 推力 けん引 牽引"
    ),
    "lateral": "lateral fy side seitenkraft seiten~ querkraft quer~ laterale 侧向 横向 横力",
    "force": "force kraft ~kraft effort fuerza forza 力 力量",
    "effort": "effort",
    "temperature": ("temperature temp celsius temperatur ~temperatur temperatura 温度"),
    # what is no measurement of wheel, carriage or forces
    "other": (
        "slip slippage schlupf glissement deslizamiento slittamento 滑转 滑移 スリップ すべり"
        " voltage volt volts spannung ~spannung tension voltaje tensione 电压 電圧 battery batt"
        " akku power leistung ~leistung puissance potencia potenza 功率 電力 pressure druck ~druck"
        " humidity steer steering lenk~ ~lenkung brake throttle pwm duty gear gang yaw roll pitch"
        " heading orientation quaternion lat lon gps"
        " imu accel acceleration beschleunigung ~beschleunigung acc gyro cov"
        " covariance radius radial diameter boom bucket error fault status state mode flag"
        " cmd command commanded target setpoint set"
        " desired ref reference soll soll~ ~soll consigne objetivo riferimento 目标 指令 目標"
        " raw roh rohwert"
    ),
}
AXES = {"x": "drawbar_pull", "y": "lateral_force", "z": "load"}  # of a force

# a unit as gritd writes it, what one of it is multiplied by -> how it is written
UNITS: dict[tuple[str, float], str] = {
    (
        "s",
        1.0,
    ): "s sec sek second seconds sekunde sekunden seconde secondes segundo segundos secondi 秒",
    ("ms", 1.0): "ms msec msek millisecond milliseconds millisekunden millis 毫秒 ミリ秒",
    ("us", 1.0): "us µs μs usec microseconds micros 微秒",
    ("ns", 1.0): "ns nsec nanoseconds 纳秒",
    ("min", 1.0): "min minute minutes minuten",
    ("rad", 1.0): "rad radian radians 弧度",
    ("deg", 1.0): "deg ° degree degrees grad grados gradi degres 度",
    ("turn", 1.0): "turn turns rev revs umdrehungen tours vueltas 圈 回転",
    ("rad/s", 1.0): "rad/s rad/sec rads rad·s⁻¹ rad.s-1 rad s-1 rad*s^-1",
    ("deg/s", 1.0): "deg/s °/s dps deg/sec grad/s",
    ("turn/s", 1.0): "rps rev/s u/s tr/s",
    ("rpm", 1.0): (
        "rpm r.p.m. u/min 1/min min-1 min^-1 min⁻¹ /min rev/min r/min tr/min giri/min vueltas/min"
        " upm"
        " 转/分 r/分 回/分"
    ),
    ("m", 1.0): "m meter meters metre metres metro metros metri 米",
    ("cm", 1.0): "cm 厘米",
    ("mm", 1.0): "mm millimeter millimeters millimetre 毫米 ミリ",
    ("um", 1.0): "um µm μm",
    ("mm", 25.4): "in inch inches",
    ("m/s", 1.0): "m/s mps m/sec m.s-1 m·s⁻¹ m*s^-1",
    ("cm/s", 1.0): "cm/s",
    ("mm/s", 1.0): "mm/s mm/sec mm.s-1 mm·s⁻¹",
    ("mm/s", 25.4): "ips in/s",
    ("m/s", 1.0 / 3.6): "km/h kph kmh",
    ("mm/s", 1.0 / 60.0): "mm/min",
    ("N", 1.0): "n newton newtons 牛 牛顿 ニュートン",
    ("kN", 1.0): "kn",
    ("N", 9.80665): "kg kgf kilogram kilograms kp 千克 公斤",
    ("N", 4.4482216): "lbf lb lbs",
    ("N*m", 1.0): "nm n.m n·m n*m n-m n⋅m newtonmeter 牛米",
    ("N*m", 1e-3): "nmm mnm n·mm n.mm",
    ("N*m", 1e-2): "ncm n·cm n.cm",
    ("N*m", 1e3): "knm",
    ("N*m", 0.1129848): "lbf-in lbf.in lbf·in ibf-in in-lb in-lbf",
    ("A", 1.0): "a amp amps ampere amperes 安 安培",
    ("mA", 1.0): "ma",
    ("V", 1.0): "v volt volts",
    ("mV", 1.0): "mv",
    ("degC", 1.0): "°c degc celsius c ℃ oc",
    ("%", 1.0): "% percent prozent",
    ("count", 1.0): "count counts cnt tick ticks inc pulses imp",
}
IN_BRACKETS = re.compile(r"[\[(（［【<]\s*([^\[\]()（）［］【】<>]*?)\s*[\])）］】>]")
CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
LATIN = re.compile(r"[a-zωθ]+")


def folded(text: str) -> str:
    """Without capitals and accents; full-width letters as plain ones."""
    apart = unicodedata.normalize("NFKD", text.casefold())
    return "".join(letter for letter in apart if not unicodedata.combining(letter))


@lru_cache(maxsize=1)
def _entries() -> tuple[dict[str, set[str]], list[tuple[str, str, str]]]:
    """Meanings of whole words, and (way, part, meaning) of the others."""
    whole: dict[str, set[str]] = {}
    parts = []
    for meaning, words in WORDS.items():
        for word in words.split():
            text = folded(word.strip("~"))
            if word.startswith("~"):
                parts.append(("end", text, meaning))
            elif word.endswith("~"):
                parts.append(("begin", text, meaning))
            elif not LATIN.fullmatch(text):
                parts.append(("in", text, meaning))
            else:
                whole.setdefault(text, set()).add(meaning)
    return whole, parts


@lru_cache(maxsize=1)
def _units() -> dict[str, tuple[str, float]]:
    return {folded(word): unit for unit, words in UNITS.items() for word in words.split()}


def unit_of(text: str) -> tuple[str, float] | None:
    """The unit that a text names, as gritd writes it, and what one is multiplied by; None for
    none.
    """
    known = _units()
    plain = folded(text.strip(" []()"))
    return known.get(plain) or known.get(plain.replace(" ", ""))


@lru_cache(maxsize=4096)
def words_of(name: str) -> tuple[str, ...]:
    """The words of a name, and its characters of other scripts together: `wheelSpeed_rpm` has
    three.
    """
    plain = folded(CAMEL.sub(" ", name))
    return tuple([word for word in re.split(r"[^a-zωθ\u0250-\uffff]+", plain) if word])


def meanings(name: str) -> set[str]:
    """What the words of a name mean, of WORDS."""
    return set().union(*[_meanings_of(word) for word in words_of(name)])


@lru_cache(maxsize=4096)
def _meanings_of(word: str) -> frozenset[str]:
    whole, parts = _entries()
    held = [meaning for way, part, meaning in parts if _holds(word, way, part)]
    return frozenset(whole.get(word, set()).union(held))


def _holds(word: str, way: str, part: str) -> bool:
    if way == "in":
        return part in word
    return word != part and (word.startswith(part) if way == "begin" else word.endswith(part))
