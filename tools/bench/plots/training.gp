# SPDX-License-Identifier: GPL-2.0-or-later
# Error on unseen cuts over the time of training, a colour and marker for each kind of method.
set title sprintf("Error on unseen cuts over the time of training, %d pairs\n\
bars: least to largest of %d data sets\n%s, %s", pairs, seeds, cpu, kernel)
set xlabel 'time of training / s'
set ylabel 'rms error on unseen cuts / N'
set logscale xy
set format x power
stats data using "seconds" prefix "time" nooutput
stats data using "rms_error_N_min" prefix "good" nooutput
stats data using "rms_error_N_max" prefix "bad" nooutput
x0 = time_min / 3
x1 = time_max * 5
y0 = good_min / 1.2
y1 = bad_max * 1.2
eval 'set ytics ('.log_tics(y0, y1).')'
eval name_margins
x(key) = log_place(column(key), x0, x1)
y(key) = log_place(column(key), y0, y1)
stats data using (strcol("name") eq "name" ? NaN : name_point(words_of(strcol("name")), x("seconds"), \
	y("rms_error_N"), x("seconds"), x("seconds"), y("rms_error_N_min"), y("rms_error_N_max"))) nooutput
eval name_points
set xrange [x0:x1]
set yrange [y0:y1]
eval key_at
plot for [i=1:words(data_kind)] data index word(data_kind, i) \
	using "seconds":"rms_error_N":"rms_error_N_min":"rms_error_N_max" \
	with yerrorbars lt i lw 1 title word(data_kind, i)
