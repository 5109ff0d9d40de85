// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The note beside each picture; see mkv.h.
 */
#include <string.h>
#include <libavutil/crc.h>
#include <libavutil/intreadwrite.h>
#include "mkv.h"

static const uint8_t mark[4] = {'I', 'N', 'C', 1};

void mkv_note_write(const struct mkv_note *note, uint8_t bytes[MKV_NOTE_BYTES])
{
	memcpy(bytes, mark, sizeof(mark));
	AV_WB32(bytes + 4, note->crc);
	AV_WB64(bytes + 8, (uint64_t)note->t_ns);
	AV_WB64(bytes + 16, note->seq);
}

bool mkv_note_read(struct mkv_note *note, const uint8_t *bytes, size_t size)
{
	if (size != MKV_NOTE_BYTES || memcmp(bytes, mark, sizeof(mark)))
		return false;
	note->crc = AV_RB32(bytes + 4);
	note->t_ns = (int64_t)AV_RB64(bytes + 8);
	note->seq = AV_RB64(bytes + 16);
	return true;
}

uint32_t mkv_crc(const uint8_t *bytes, size_t size)
{
	return ~av_crc(av_crc_get_table(AV_CRC_32_IEEE_LE), ~0U, bytes, size);
}
