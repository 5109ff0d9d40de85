/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What the writer and the reader of camera.mkv share: the note beside each picture and its
 * CRC; see ../record/frames.h.
 */
#ifndef INCISE_FRAMES_MKV_H
#define INCISE_FRAMES_MKV_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include "../frames.h"

#define MKV_NOTE_BYTES 24

struct mkv_note {
	uint32_t crc;
	int64_t t_ns;
	uint64_t seq;
};

void mkv_note_write(const struct mkv_note *note, uint8_t bytes[MKV_NOTE_BYTES]);

/* False: it is none of ours. */
bool mkv_note_read(struct mkv_note *note, const uint8_t *bytes, size_t size);

/* CRC-32 as zlib's. */
uint32_t mkv_crc(const uint8_t *bytes, size_t size);

struct incise_frames_writer *mkv_writer_new(const char *path,
					    const struct incise_frames_shape *shape,
					    const struct incise_frames_options *options,
					    struct incise_error *err);
struct incise_frames_reader *mkv_reader_new(const char *path, struct incise_error *err);

#endif
