# 40 s of a sine of 0.2 Hz at 20 Hz after 2 s of rest, and a stroke in mm with V^2 that creeps: voltage and stroke as functions of the time t,
# the row k and both of them; every third argument's row only. The drive has half of the sine from 22 s on.
awk "BEGIN {
    print \"time_s,voltage_v,displacement_mm\"
    for (k = 0; k <= 840; k += ${3:-1}) {
        t = k / 20
        sine = t < 2 ? 0 : 1500 * (1 - cos(2 * atan2(0, -1) * 0.2 * (t - 2)))
        drive = t < 22 ? sine : sine / 2
        stroke = 2 * ((\"$1\" == \"sine\" ? sine : drive) / 3000) ^ 2 + 0.002 * t
        print t \",\" ($1) \",\" ($2)
    }
}" > film.csv
