# SPDX-License-Identifier: GPL-2.0-or-later
# Films of pictures; lib/view loads it.
modules := film_mkv
pc_film_mkv := libavformat libavcodec libavutil $(if $(has_view),,$(pc_incise-view))
