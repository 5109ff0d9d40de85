# SPDX-License-Identifier: GPL-2.0-or-later
# Pictures of a camera in a Matroska file.
modules := frames_mkv
pc_frames_mkv := libavformat libavcodec libavutil libcrypto
