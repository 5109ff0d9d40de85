# SPDX-License-Identifier: GPL-2.0-or-later
# The style of every figure of incise: terminal, fonts, colours, markers, axes and key. Each script
# in this folder loads it. Change it here and draw again, for example as a vector file for a journal:
#
#     gnuplot -e "ext='pdf'" NAME.gp        ext: png (twice the pixels of the screen), svg or pdf

if (!exists("ext")) { ext = 'png' }
if (!exists("width")) { width = 900; height = 560 } # of a script, in pixels of 1/96 inch
font = 'DejaVu Sans' # px: normal 14, small 12; a figure of 900 px printed 180 mm wide has 8 pt
small = font.',12'
large = font.',15'
set encoding utf8
if (ext eq 'svg') { set terminal svg size width, height font font.',14' linewidth 1.2 background 'white' }
if (ext eq 'png') { set terminal pngcairo size 2 * width, 2 * height font font.',14' fontscale 1.5 \
	linewidth 2.4 pointscale 2 }
if (ext eq 'pdf') { set terminal pdfcairo size width / 96.0, height / 96.0 font font.',14' \
	fontscale 0.75 linewidth 1.2 pointscale 0.75 }

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
set linetype 1 lc rgb blue lw 1.5 pt 7 ps 0.7
set linetype 2 lc rgb vermillion lw 1.5 pt 5 ps 0.65
set linetype 3 lc rgb green lw 1.5 pt 9 ps 0.8
set linetype 4 lc rgb purple lw 1.5 pt 13 ps 0.9
set linetype 5 lc rgb orange lw 1.5 pt 11 ps 0.8
set linetype 6 lc rgb sky lw 1.5 pt 6 ps 0.8
set linetype 7 lc rgb ink lw 1.5 pt 4 ps 0.7
set linetype 8 lc rgb grey lw 1.5 pt 2 ps 0.8
set linetype cycle 8

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
set key noautotitle noenhanced Left reverse samplen 2 spacing 1.1
