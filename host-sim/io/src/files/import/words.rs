//! Words in titles of columns, in the languages of laboratories, with blanks between them.

use super::Quantity;

/// Whether `word` is one of `words`, with blanks between them.
pub(super) fn is_of(words: &str, word: &str) -> bool {
    words.split(' ').any(|known| known == word)
}

/// Whether a word of `text`, in any case of letters, is one of `words`.
pub(super) fn has_word(words: &str, text: &str) -> bool {
    text.to_lowercase().split(|c: char| !c.is_alphanumeric()).any(|word| is_of(words, word))
}

/// Words that name a quantity anywhere in a title.
pub(super) const WORDS: &[(Quantity, &str)] = &[
    (
        Quantity::Time,
        "time zeit prüfzeit messzeit temps tiempo tempo tijd tid czas čas idő zaman время elapsed timestamp 时间 時間",
    ),
    (
        Quantity::Voltage,
        "voltage volts hv hvps highvoltage potential potenzial potentiel spannung hochspannung tension tensión voltaje tensione tensão spanning \
    spänning spænding napięcie napětí feszültség gerilim напряжение 电压 電壓 高压 電圧 vmon umon",
    ),
    (Quantity::Force, "force load loadcell kraft standardkraft prüfkraft zugkraft fuerza forza 力 载荷"),
    (
        Quantity::Displacement,
        "displacement stroke laser extensometer extension elongation deflection travel position weg standardweg traversenweg hub auslenkung verschiebung \
    posición posizione posição poloha pozycja konum läge uitwijking verplaatsing przemieszczenie elmozdulás перемещение положение \
    deplacement déplacement desplazamiento spostamento 位移 変位",
    ),
];

/// Words for what is not in recordings, which count where such a quantity is asked for.
pub(super) const OTHER_WORDS: &[(Quantity, &str)] =
    &[(Quantity::Stretch, "stretch lambda λ"), (Quantity::Stress, "stress zugspannung contrainte")];

/// Words for the displacement of a machine or a stage.
pub(super) const MACHINES: &str = "position extensometer extension elongation travel weg standardweg traversenweg traverse crosshead poloha pozycja konum posizione posição posición 位置";

/// Words that name which of an amplifier's two voltages a column is.
pub(super) const OF_TWO_VOLTAGES: &[(Quantity, &str)] = &[
    (Quantity::Command, "command cmd setpoint set demand target input control soll sollwert"),
    (Quantity::Voltage, "monitor mon vmon umon readback measured actual output ist istwert"),
];

/// Words for amplifiers and for what they drive.
pub(super) const DRIVEN: &str = "trek matsusada amplifier amp verstärker hochspannungsverstärker amplificateur amplificador film electrode elektrode dea actuator aktor";

/// Words and units of temperatures.
pub(super) const TEMPERATURES: &str =
    "temperature temp temperatur température temperatura thermocouple pt100 ntc 温度 溫度 気温 室温";
pub(super) const DEGREES: &str = "°C ℃ °F ℉ degC degF";

/// Units of temperatures that are not °C, and of sensors of one.
pub(super) const NO_CELSIUS: &str = "°F ℉ degF F K °K V mV mA Ω ohm";

/// Units and counts of quantities that recordings do not have; also in front of a slash and the unit that they are divided by.
pub(super) const OTHER_UNITS: &str = "count counts cts digit digits pulse pulses step steps px pixel pixels cycles % %rh ° °c c degc ℃ °f k g kg a ma µa ua na \
    hz khz rad deg w bar mbar nm n·m ohm ω kω mω f pf nf c nc pc lx db";

/// Words of a factor.
pub(super) const FACTORS: &str = "tenth tenths hundredth hundredths hundred hundreds thousand thousands zehntel hundertstel tausendstel dixième \
    dixièmes centième centièmes décima décimas fold fach \
    half semi halved double doubled twice hälfte halb halbe doppelt doble mitad moitié";

/// Letters that name a quantity where they are all of a name.
pub(super) const LETTERS: &[(Quantity, &str)] = &[
    (Quantity::Time, "t x_value"),
    (Quantity::Voltage, "u v"),
    (Quantity::Force, "f"),
    (Quantity::Displacement, "x disp pos"),
];

/// Parts of words for what was asked for. Those of five letters and more are found within words too, as German joins them.
pub(super) const ORDERED: &str = "target tgt referenc référenc referenz ref riferiment setpoint setpt sp set setting limit lim demand program \
    prog stage command cmd desired wanted request preset nominal goal ideal ceiling ovp ctrl ao xd des desir \
    planned intended ordered waveform arb awg trajectory profile control compliance trip threshold alarm interlock breakdown generator dac motor \
    soll sollwert vorgab grenz führungs 参考 wunsch ziel nenn stell consign cible objetivo desead impost obiettivo \
    richiest desiderat doel gewenst börvärd zadan žádan inställ ingesteld nastaw előírt \
    ajustad hedef задан referênc 设定 設定 目标 目標 给定 指令 指定";
/// Parts of words for what was computed.
pub(super) const DERIVED: &str = "rms eff effekti efficac eficaz filter filtr smooth geglätt lissé lowpass tiefpass max maxim máxim min minim \
    mínim peak pk pp pkpk ptp spitze crête average avg mean median mittel moyen medio media promedio std sd \
    stdev sigma varian error err deviation dev abweich fehler schlepp residu theor théor model fem simul predict \
    filt estimat est pred sim hat interp lp 理論 理论 推定 估计 预测 預測 予測 仿真 模拟 滤波 濾波 \
    geschätzt expected calc comput berechnet fit fitted detrend normaliz normalis normier interpol \
    corr corrected shifted delayed lagged prev offset zero tare ripple noise ac range scale gain amplitude envelope delta drift cumul squared \
    resolution auflösung uncertain unsicher uncalibrated unkalibriert initial reversed inverted inv negated neg negative negativ minus abs differenc differenz \
    fft log log10 sqrt velocity \
    travelled traveled accumul path zurückgelegt increments dvoltage hex geschwindigkeit 速度 误差 誤差 平均 最大 最小 有效 実効 峰值";
/// Words for the stress of the stretched cross-section, which is computed from that of the unstretched one.
pub(super) const TRUE_STRESS: &str = "true cauchy wahre vraie";
/// Words for the time from one row to the next.
pub(super) const STEPS: &str = "interval intervall dt";
/// Further words for times that are not those of the rows.
pub(super) const NO_TIMES: &str = "delta diff last squared sqrt log log10 jitter constant konstante exposure left remaining \
    countdown restzeit";
/// Parts of words for what does not move.
pub(super) const SIZES: &str = "thickness width length diameter radius gap prestretch standoff x0 l0 wavelength dicke breite länge épaisseur largeur longueur 厚";
/// Parts of words for voltages of the mains, of supplies, of sensors, of switches and of what controls an amplifier, and for currents.
pub(super) const ELSEWHERE: &str = "mains line grid netz secteur netspanning rete battery batterie batterij batería heater heating heiz pump \
    cooler peltier piezo aux auxiliary logic gate bridge shunt thermocouple photodiode sensor gauge pot input vin uin \
    eingang entrée entrada ingresso steuer ai adc cc dd bus usb ups psu 5v 12v 24v enable disable status state \
    switch relay current strom courant corrente corriente 电流 電流 市电 電源 电源 控制 输入";

/// The words of `name` in small letters, also those that begin with a capital within a word.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut words = Vec::new();
    for word in name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()) {
        words.push(word.to_lowercase());
        let mut start = 0;
        let mut before = ' ';
        for (at, c) in word.char_indices() {
            if before.is_lowercase() && c.is_uppercase() {
                words.push(word[start..at].to_lowercase());
                start = at;
            }
            before = c;
        }
        if start > 0 {
            words.push(word[start..].to_lowercase());
        }
    }
    words
}

/// Opening and closing brackets around units.
const BRACKETS: [(char, char); 4] = [('(', ')'), ('[', ']'), ('{', '}'), ('（', '）')];

/// Text outside of brackets, and inside of each pair.
pub(super) fn without_brackets(title: &str) -> (String, Vec<String>) {
    let (mut outside, mut inside) = (String::new(), Vec::new());
    let mut open: Option<(char, String)> = None;
    for letter in title.chars() {
        match &mut open {
            Some((end, text)) => {
                if letter == *end {
                    inside.push(std::mem::take(text));
                    open = None;
                } else {
                    text.push(letter);
                }
            }
            None => match BRACKETS.iter().find(|(start, _)| *start == letter) {
                Some((_, end)) => {
                    outside.push(' ');
                    open = Some((*end, String::new()));
                }
                None => outside.push(letter),
            },
        }
    }
    if let Some((_, text)) = open {
        outside.push_str(&text);
    }
    (outside, inside)
}

/// The quantity of a name of one letter.
pub(super) fn letter_quantity(name: &str) -> Option<Quantity> {
    let name = name.trim().to_lowercase();
    LETTERS.iter().find(|(_, letters)| is_of(letters, &name)).map(|(quantity, _)| *quantity)
}
