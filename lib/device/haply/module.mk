# SPDX-License-Identifier: GPL-2.0-or-later
# Haply's Inverse3 behind its service: JSON over a WebSocket.
modules := haptic_haply
pc_haptic_haply := libwebsockets jansson
