# A log of 100 rows: command and monitor as functions of the row k.
awk "BEGIN {
    print \"time_s,command_v,monitor_v\"
    for (k = 0; k < 100; k++) print k \",\" ($1) \",\" ($2)
}" > bad.csv
