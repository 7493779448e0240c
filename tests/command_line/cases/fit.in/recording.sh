# A recording of a film with creep and noise: voltage and displacement as functions of the time t, and of what they would be, v and x; how
# many seconds, and rows per second.
awk "BEGIN {
    print \"time_s,voltage_v,displacement_m\"
    for (k = 0; k <= $3 * $4; k++) {
        t = k / $4
        v = 3000 * (1 - cos(2 * atan2(0, -1) * t / 7))
        x = 0.002 * (v / 6000) ^ 2 + 0.0003 * (1 - exp(-t / 20)) + 5e-6 * sin(1000 * t)
        print t \",\" ($1) \",\" ($2)
    }
}" > rec.csv
