# SPDX-License-Identifier: GPL-2.0-or-later
# Swing of learned models under a leaning hand, by what the plan said, over the device's damping.
set title "Learned models: widest swing under 11 leans, as the plan judged them"
set logscale xy
set xlabel 'damping of the device / (mN s/mm)'
set ylabel 'to and fro in the last quarter of 8 s / mm'
set format y '%.0e'
set yrange [1e-7:100]
set xrange [3.5:70]
set xtics (5, 10, 20, 50)
set key below
least(y) = y < 2e-7 ? 2e-7 : y
# Cases of one damping stand beside each other, by mass and tracker.
beside(b, m, hz) = 1e3 * b * (1 + 2 * (m - 0.06) + (hz - 140) * 4e-4)
set arrow from 3.5, 0.01 to 70, 0.01 nohead dt 2
set label 'more is a swing' at 3.7, 0.016
plot for [v in data_blocks] data index v \
	using (beside(column("damping_N_s_mm"), column("mass_kg"), column("tracker_hz"))):(least(column("swing_mm"))) \
	with points pt (v eq "accepted" ? 7 : 2) ps 0.7 lc rgb (v eq "accepted" ? green : vermillion) \
	title v
