# SPDX-License-Identifier: GPL-2.0-or-later
# The style of every figure of incise: terminal, fonts, colours, markers, axes and key. Each script
# in this folder loads it. Change it here and draw again, for example as a vector file for a journal:
#
#     gnuplot -e "ext='pdf'" NAME.gp        ext: png (twice the pixels of the screen), svg or pdf

if (!exists("ext")) { ext = 'png' }
if (!exists("figure_width")) { figure_width = 900; figure_height = 560 } # of a script, in pixels of 1/96 inch
paper = '#FFFFFF'
font = 'DejaVu Sans' # px: normal 14, small 12; a figure of 900 px printed 180 mm wide has 8 pt
small = font.',12'
large = font.',15'
set encoding utf8
if (ext eq 'svg') { set terminal svg size figure_width, figure_height font font.',14' linewidth 1.2 background paper }
if (ext eq 'png') { set terminal pngcairo size 2 * figure_width, 2 * figure_height font font.',14' fontscale 1.5 \
	linewidth 2.4 pointscale 2.6 }
if (ext eq 'pdf') { set terminal pdfcairo size figure_width / 96.0, figure_height / 96.0 font font.',14' \
	fontscale 0.75 linewidth 1.2 pointscale 0.95 }
# `eval end_figure` closes the file; whoever reads an SVG without this font gets one of its widths.
font_names = "sed -i 's/font-family=\"DejaVu Sans\"/font-family=\"DejaVu Sans, Verdana, sans-serif\"/g' "
end_figure = 'unset output; if (ext eq "svg") { font_names = system(font_names.figure_file) }'
# px from one line of text to the next: gnuplot places the lines of an SVG farther apart.
line_px = ext eq 'svg' ? 21.0 : 17.0

# Okabe and Ito's colours, which colour-blind readers tell apart, each with a marker of its own: a
# printed page without colour still shows which series is which. Yellow is too pale for lines.
ink = '#000000'
grey = '#808080'
pale = '#E4E4E4'
blue = '#0072B2'
vermillion = '#D55E00'
green = '#009E73'
purple = '#CC79A7'
orange = '#E69F00'
sky = '#56B4E9'
set linetype 1 lc rgb blue lw 1.5 pt 7 ps 0.56
set linetype 2 lc rgb vermillion lw 1.5 pt 5 ps 0.52
set linetype 3 lc rgb green lw 1.5 pt 9 ps 0.64
set linetype 4 lc rgb purple lw 1.5 pt 13 ps 0.72
set linetype 5 lc rgb orange lw 1.5 pt 11 ps 0.64
set linetype 6 lc rgb sky lw 1.5 pt 6 ps 0.64
set linetype 7 lc rgb ink lw 1.5 pt 4 ps 0.56
set linetype 8 lc rgb grey lw 1.5 pt 2 ps 0.64
set linetype cycle 8
colour(k) = word(blue.' '.vermillion.' '.green.' '.purple.' '.orange.' '.sky.' '.ink.' '.grey, (k - 1) % 8 + 1)

# Viridis: even steps of lightness, in colour and in print.
set palette defined (0 '#440154', 1 '#472C7A', 2 '#3B518B', 3 '#2C718E', 4 '#21908D', 5 '#27AD81', \
	6 '#5CC863', 7 '#AADC32', 8 '#FDE725')
set pm3d border lc rgb ink lw 0.2

# Axes: a frame on two sides, a pale grid behind the data, and a true minus sign. A logarithmic axis
# over many decades takes the format power: 10⁻⁶.
power = '10^{%L}'
set format '%h'
set minussign
set border 3 lc rgb ink lw 0.8
set tics nomirror out scale 0.6
set grid lt 1 lw 0.6 lc rgb pale
set title noenhanced
set xlabel noenhanced
set ylabel noenhanced
set y2label noenhanced
set zlabel noenhanced
set cblabel noenhanced
# Off until a script places it: an empty key hides the grid, too.
set key off noautotitle noenhanced Left reverse samplen 2 spacing 1.15 height 0.3
set pointintervalbox 0.001 # no white disc on error bars; gnuplot takes 0 for 1
# Panels with margins in px: above(n) for a title of n lines and a title of each panel, below(rows)
# for tics, label and a key of so many rows, between for the tics, label and title of two panels.
above(n) = (n + 2.6) * line_px
below(rows) = (3.4 + 1.3 * rows) * line_px + 8
between = 5.8 * line_px
panels(left, right, bottom, top, across, down) = sprintf("margins screen %.5f,%.5f,%.5f,%.5f \
spacing screen %.5f,%.5f", 1.0 * left / figure_width, 1 - 1.0 * right / figure_width, 1.0 * bottom / figure_height, \
	1 - 1.0 * top / figure_height, 1.0 * across / figure_width, 1.0 * down / figure_height)

# One key below the axis of a plot, and below the panels of several: `eval key_below`, or for more
# rows `key_rows = 2; eval key_below`; and `eval key_panel` behind the last panel, followed by a
# plot of NaN with the titles.
key_rows = 1
key_at = 'set key on at screen 0.5, screen 8.0 / figure_height center bottom horizontal'
key_below = 'set bmargin at screen below(key_rows) / figure_height; '.key_at
key_panel = 'set lmargin at screen 0.01; set rmargin at screen 0.99; set bmargin at screen 0; \
	set tmargin at screen 3.0 * line_px / figure_height; unset logscale; unset xlabel; unset ylabel; unset title; \
	unset tics; unset border; unset grid; unset label; unset arrow; unset object; \
	set xrange [0:1]; set yrange [0:1]; '.key_at

# Tics of a logarithmic axis that spans a decade or two, for example
# eval 'set ytics ('.log_tics(low, high).')': 1, 2, 5, 10 …, and more between within a decade.
log_steps(low, high) = high / low > 200 ? "1" : high / low > 8 ? "1 2 5" : high / low > 2.5 ? "1 1.5 2 3 5 7" : \
	"1 1.2 1.4 1.6 1.8 2 2.5 3 3.5 4 5 6 7 8 9"
log_decade(steps, k, d, low, high) = k > words(steps) ? '' : (v = d * word(steps, k), v < 0.999 * low || v > 1.001 * high ? '' : \
	sprintf('%g,', v)).log_decade(steps, k + 1, d, low, high)
log_list(steps, d, low, high) = d > high ? '' : log_decade(steps, 1, d, low, high).log_list(steps, 10 * d, low, high)
log_tics(low, high) = (all = log_list(log_steps(low, high), 10.0**floor(log10(low)), low, high), \
	strlen(all) ? all[:strlen(all) - 1] : sprintf('%g', low))

# A name of the data as words: fixed_table_64 is "fixed table 64".
words_of(s) = strstrt(s, '_') ? s[:strstrt(s, '_') - 1].' '.words_of(s[strstrt(s, '_') + 1:]) : s

# Names next to points, of which none covers another, a marker or an error bar. A script fixes the
# ranges and the plot's margins with `eval name_margins`, adds each point with name_point(), and
# places all with `eval name_points`: each name tries distances and directions around its point.
name_left = 90.0; name_right = 30.0; name_top = 3.4 * line_px + 14; name_bottom = below(1) # px
name_margins = 'set lmargin at screen name_left / figure_width; set rmargin at screen 1 - name_right / figure_width; \
	set bmargin at screen name_bottom / figure_height; set tmargin at screen 1 - name_top / figure_height; \
	name_width = figure_width - name_left - name_right; name_height = figure_height - name_top - name_bottom; \
	name_n = 0'
array name_text[200]
array name_x[200] # of the marker, px in the plot
array name_y[200]
array name_x0[200] # of its bars
array name_x1[200]
array name_y0[200]
array name_y1[200]
array name_at[200] # left end of the text
array name_up[200] # its middle
array name_long[200]
name_point(text, x, y, x0, x1, y0, y1) = (name_n = name_n + 1, name_text[name_n] = text, \
	name_x[name_n] = x * name_width, name_y[name_n] = y * name_height, \
	name_x0[name_n] = x0 * name_width, name_x1[name_n] = x1 * name_width, \
	name_y0[name_n] = y0 * name_height, name_y1[name_n] = y1 * name_height, \
	name_long[name_n] = 7.0 * strlen(text), name_at[name_n] = -1e4, name_up[name_n] = -1e4, name_n)
# The place on a logarithmic axis, 0 to 1.
log_place(x, a, b) = x <= a ? 0 : x >= b ? 1 : log(x / a) / log(b / a)
name_both(a0, a1, b0, b1) = a1 < b0 || b1 < a0 ? 0.0 : (a1 < b1 ? a1 : b1) - (a0 > b0 ? a0 : b0)
# px² of a name at x, y on the name, marker and bars of point j.
name_covers(i, j, x, y) = (i == j ? 0 : 20 * name_both(x - 2, x + name_long[i] + 2, name_at[j], \
		name_at[j] + name_long[j]) * name_both(y - 8, y + 8, name_up[j] - 8, name_up[j] + 8)) + \
	10 * name_both(x, x + name_long[i], name_x[j] - 6, name_x[j] + 6) * name_both(y - 7, y + 7, name_y[j] - 6, \
		name_y[j] + 6) + \
	4 * name_both(x, x + name_long[i], name_x0[j] - 1, name_x1[j] + 1) * name_both(y - 7, y + 7, name_y[j] - 3, \
		name_y[j] + 3) + \
	3 * name_both(x, x + name_long[i], name_x[j] - 2, name_x[j] + 2) * name_both(y - 7, y + 7, name_y0[j], name_y1[j])
name_cost(i, x, y) = (x < 2 || x + name_long[i] > name_width + name_right - 4 || y < 10 || \
		y > name_height ? 1e6 : 0) + (sum [j=1:name_n] name_covers(i, j, x, y))
name_points = 'do for [pass=1:4] { do for [turn=1:name_n] { i = pass % 2 ? turn : name_n + 1 - turn; least = 1e9; do for [k=0:59] { \
	ring = 10 + 9 * (k / 12); angle = (k % 12) * pi / 6; \
	x = name_x[i] + ring * cos(angle) - (cos(angle) < -0.1 ? name_long[i] : cos(angle) < 0.1 ? \
		name_long[i] / 2 : 0); y = name_y[i] + 1.2 * ring * sin(angle); \
	cost = name_cost(i, x, y) + 5 * ring - 6 * cos(angle); \
	if (cost < least) { least = cost; best_x = x; best_y = y } }; \
	name_at[i] = best_x; name_up[i] = best_y } }; \
	do for [i=1:name_n] { set label 1000 + i name_text[i] at graph name_at[i] / name_width, \
	graph name_up[i] / name_height left front noenhanced font small; \
	x = name_x[i] < name_at[i] ? name_at[i] - 1 : name_x[i] > name_at[i] + name_long[i] ? \
		name_at[i] + 0.92 * name_long[i] : name_x[i]; \
	y = name_y[i] < name_up[i] - 7 ? name_up[i] - 7 : name_y[i] > name_up[i] + 7 ? name_up[i] + 7 : name_up[i]; \
	if ((x - name_x[i])**2 + (y - name_y[i])**2 > 200) { set arrow 1000 + i from \
		graph name_x[i] / name_width, graph name_y[i] / name_height to graph x / name_width, \
		graph y / name_height nohead lw 0.6 lc rgb grey back } }'
