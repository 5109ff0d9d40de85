// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module of pictures in Matroska. All it does is behind mkv.h.
 */
#include "mkv.h"

INCISE_API extern const struct incise_frames_module incise_frames;

const struct incise_frames_module incise_frames = {
	.abi = INCISE_FRAMES_ABI,
	.create = mkv_writer_new,
	.open = mkv_reader_new,
};
