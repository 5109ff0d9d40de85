#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# incise-haptic@.service in a Debian that systemd has booted: our packages, the kernel module on
# the simulated chip, the virtual tracker or a FASTRAK on a USB of the kernel's own.
#
#   carriage  0 .......................... 30 mm      50 steps/mm, 1.5 steps/ms at most
#             home's edge: no force
#   surface             22 mm: a tool as deep as d mm has the nut at 22 - d mm and a bit
cd /opt/test || exit 1
. ./tap
. ./words

install_packages() { dpkg -i ./*.deb; }
check "the packages install" install_packages || exit 0
check "they bring a user" id incise
check "and a folder for state pages" [ "$(stat -c '%a %U %G' /run/incise)" = "2775 root incise" ]

wire()
{
	for line in step=0 dir=1 enable=2 limit_min=3 limit_max=4 home=5; do
		echo "bench/motor0/${line%=*}=incise-sim:${line#*=}"
	done >>/etc/incise/stepper.conf
	echo bench/estop=incise-sim:7 >>/etc/incise/stepper.conf
	echo "number=0 step=0 dir=1 enable=2 min=3 max=4 home=5 min_at=-100 max_at=1000000" \
		"home_at=-300..0 position=200" >$sim/carriage
}
refuses_missing_chip() { ! systemctl start incise-stepper; }
from_now
check "the simulated chip loads" modprobe incise_sim || exit 0
check "a controller is wired" wire || exit 0
sed -i s/incise-sim:5/incise-sin:5/ /etc/incise/stepper.conf
check "a chip that is missing is refused" refuses_missing_chip
check "with the line of the file" told ": bench/motor0/home: no chip labelled incise-sin; " incise-stepper
sed -i s/incise-sin:5/incise-sim:5/ /etc/incise/stepper.conf
check "the service tries again, and sets it up" comes is ActiveState active incise-stepper || exit 0
node=/dev/$(cat $controller/cdev)
owned() { [ "$(stat -c '%a %U %G' "$node")" = "660 root incise" ]; }
check "udev gave its node to the group" comes owned
mkdir -p /etc/incise/scenes
cp /usr/share/incise/scenes/wall.scene $scene
rig sim: 0

# INCISE_VM_PARTS: for who works on one of them.
for part in ${INCISE_VM_PARTS:-life faults tracker removal}; do
	. "./$part"
done
