# SPDX-License-Identifier: GPL-2.0-or-later
# A tracker of an OpenIGTLink server. incise serve packs its messages by the same code.
modules := tracker_igtl
headers_tracker_igtl := openigtlink/igtl_util.h
libs_tracker_igtl := -lOpenIGTLink
commands_tracker_igtl := serve
