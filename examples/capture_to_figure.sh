#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# From a capture to figures: records cuts, proves the recording complete, averages it, learns the
# force from it, and draws both.
#
#   capture_to_figure.sh FOLDER          on the simulated rig, in simulated time
#   RIG=rig.conf capture_to_figure.sh FOLDER
set -eu
mkdir -p "${1:?FOLDER is missing: the folder for recording, data, model and figures}"
rig=${RIG:-sim:seed=1,clock=simulated,depth_mm=10,times=4}
case $rig in sim:*) ;; *) rig=$(realpath "$rig") ;; esac
cd "$1"

incise capture -o cuts.rec --rig "$rig"
incise verify cuts.rec
incise export cuts.rec --average 12x10,by-cut | tee pairs.csv |
	incise train - --group cut -o force.fis
incise plot cuts.rec -o recording.png
incise plot force.fis --data pairs.csv -o force.svg
