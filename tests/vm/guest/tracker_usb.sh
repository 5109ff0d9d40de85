#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A FASTRAK on a USB of the kernel's own: the emulator of tests/polhemus behind FunctionFS on
# dummy_hcd, and the backend "usb" at the other end, through libusb.
. tests/vm/tap

[ -e "$INCISE_BUILD/lib/incise/tracker_usb.so" ] || skip "tracker on USB" "tracker_usb.so was not built"
[ -x "$INCISE_BUILD/tests/polhemus/fastrak" ] || skip "tracker on USB" "the emulator was not built"
modprobe -a usb_f_fs libcomposite dummy_hcd 2>/dev/null || skip "tracker on USB" "this kernel has no dummy_hcd"
export INCISE_MODULE_PATH="$INCISE_BUILD/lib/incise"
program=$INCISE_BUILD/tests/vm/tracker_usb
gadget=/sys/kernel/config/usb_gadget/tracker

# gadget PRODUCT: made, and the emulator behind it.
make_gadget()
{
	mkdir -p $gadget/strings/0x409 $gadget/configs/c.1 $gadget/functions/ffs.tracker
	echo 0x0f44 >$gadget/idVendor
	echo "$1" >$gadget/idProduct
	echo "$2" >$gadget/strings/0x409/serialnumber
	ln -s $gadget/functions/ffs.tracker $gadget/configs/c.1
	mkdir -p /run/ffs
	mount -t functionfs tracker /run/ffs
	mkfifo /run/emulator.in
	"$INCISE_BUILD/tests/polhemus/fastrak" --usb /run/ffs </run/emulator.in >/run/emulator 2>&1 7>&- &
	emulator=$!
	exec 8>/run/emulator.in
	i=0
	until grep -q "ready usb" /run/emulator || [ $i = 500 ]; do
		sleep 0.02
		i=$((i + 1))
	done
	udc=$(ls /sys/class/udc | head -n 1)
	echo "$udc" >$gadget/UDC
	i=0
	until grep -qs 0f44 /sys/bus/usb/devices/*/idVendor || [ $i = 500 ]; do
		sleep 0.02
		i=$((i + 1))
	done
}

remove_gadget()
{
	echo "" >$gadget/UDC 2>/dev/null
	exec 8>&-
	kill $emulator
	wait $emulator 2>/dev/null
	umount /run/ffs
	rm -f $gadget/configs/c.1/ffs.tracker /run/emulator.in
	rmdir $gadget/functions/ffs.tracker $gadget/configs/c.1 $gadget/strings/0x409 $gadget
}

lists()
{
	"$program" --list | grep -F "$1"
}

make_gadget 0x0002 SN-77
check "it is listed with the string of rig.conf" lists "ready usb:0f44:0002#SN-77: FASTRAK"
place=$(basename "$(dirname "$(grep -l 0f44 /sys/bus/usb/devices/*/idVendor)")")
# TRACKER_SECONDS=600 for the ten minutes that tests/unit/polhemus has in a time of its own.
"$program" "0f44:0002" "${TRACKER_SECONDS:-10}"
"$program" "0f44:0002@$place" 1
"$program" "0f44:0002#SN-77" 1
check "another place is none" "$program" --refuse "0f44:0002@9-9" "no 0f44:0002@9-9 is attached"
check "another number is none" "$program" --refuse "0f44:0002#SN-78" "no 0f44:0002#SN-78 is attached"
"$program" --replug "0f44:0002" "echo >$gadget/UDC" "echo $udc >$gadget/UDC"
echo sent >&8
sleep 0.2
check "its EEPROM was never written" grep -q "^sent .* eeprom 0$" /run/emulator
remove_gadget

make_gadget 0x0001 ""
check "one without firmware is listed" lists "waits usb:0f44:0001@$place: FASTRAK without firmware"
check "and named where one with it was asked for" "$program" --refuse "0f44:0002" "fxload"
remove_gadget
modprobe -r dummy_hcd usb_f_fs libcomposite 2>/dev/null
check "the modules go" [ ! -d /sys/module/dummy_hcd ]
