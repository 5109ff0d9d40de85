# SPDX-License-Identifier: GPL-2.0-or-later
# Error of what a screen shows over the run time for it, a line for each texture; at each point its
# frames per second.
array low[3]
array high[3]
array axis[3] = ["x", "y", "y"]
stats data using "ms_per_s" nooutput
low[1] = STATS_min
high[1] = STATS_max
# Where two are the same to the last digit there is no place of 0.
stats data using (column("rms") > 1e-6 ? column("rms") : 1e-6) nooutput
low[2] = STATS_min
high[2] = STATS_max
stats data using (1 - column("ssim") > 1e-6 ? 1 - column("ssim") : 1e-6) nooutput
low[3] = STATS_min
high[3] = STATS_max
# Tics of 1, 2, 5, 10 … near the axis.
decade(k) = 10.0**floor(log10(low[k]))
three(d) = sprintf("%g, %g, %g", d, 2 * d, 5 * d)
tics(d, end) = d < end ? three(d).(10 * d < end ? ", ".tics(10 * d, end) : "") : ""
set multiplot layout 1,2 title sprintf("What a screen shows of a cut that bleeds, at 15, 30 and 60 frames a second, against a texture of %d² at that very moment", \
	word(data_texture_px, words(data_texture_px)) + 0) font large
set logscale xy
set key bottom left
set xlabel 'run time for a second that is shown / ms'
error(k) = k == 2 ? column("rms") : 1 - column("ssim")
do for [k=2:3] {
	set ylabel k == 2 ? 'rms error / values of sRGB' : '1 - structural similarity'
	do for [i in sprintf("1 %d", k)] {
		n = int(i)
		eval sprintf("set %srange [%g:%g]", axis[n], low[n] / 1.3, high[n] * 1.5)
		eval sprintf("set %stics (%s)", axis[n], tics(decade(n), 2 * high[n]))
	}
	plot for [i=1:words(data_blocks)] data index word(data_blocks, i) \
			using "ms_per_s":(error(k)) with linespoints ls i pt 7 ps 0.9 \
			title sprintf("texture %s²", word(data_blocks, i)), \
		for [i=1:words(data_blocks)] data index word(data_blocks, i) \
			using "ms_per_s":(error(k)):"fps" \
			with labels noenhanced offset 0.6,0.6 left font small notitle
}
unset multiplot
