// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Rows and blocks of the ledger; see ledger.h.
 */
#include <math.h>
#include <string.h>
#include "../base/crc32c.h"
#include "ledger.h"

const struct incise_ledger_form incise_ledger_forms[INCISE_LEDGER_STREAMS] = {
	[INCISE_LEDGER_FORCE] = {"force", "force", "seq, t_ns, code", "iii"},
	[INCISE_LEDGER_TRACKER] = {"tracker", "tracker",
				   "seq, t_ns, arrival_ns, x_mm, y_mm, z_mm, qw, qx, qy, "
				   "qz, status, station, button",
				   "iiirrrrrrrcii"},
	[INCISE_LEDGER_CAMERA] = {"camera", "frames",
				  "seq, t_ns, arrival_ns, pts, bytes, crc, length_px, "
				  "sd_px, depth_mm, quality",
				  "iiiiiinnnn"},
};

/* --- rows ------------------------------------------------------------------------- */

static uint8_t *put(uint8_t *to, uint64_t value)
{
	for (int i = 0; i < 8; i++)
		to[i] = value >> 8 * i;
	return to + 8;
}

static void put_integer(struct incise_ledger_row *row, int64_t value)
{
	put(row->bytes + row->n, value);
	row->n += 8;
}

static void put_real(struct incise_ledger_row *row, double value)
{
	uint64_t bits = 0x7ff8000000000000;

	value += 0.0; /* -0 becomes 0 */
	if (!isnan(value))
		memcpy(&bits, &value, sizeof(bits));
	put_integer(row, bits);
}

void incise_ledger_row_force(struct incise_ledger_row *row, uint64_t seq, int64_t t_ns,
			     int32_t code)
{
	row->seq = seq;
	row->t_ns = t_ns;
	row->n = 0;
	put_integer(row, seq);
	put_integer(row, t_ns);
	put_integer(row, code);
}

void incise_ledger_row_tracker(struct incise_ledger_row *row, int64_t t_ns,
			       const struct incise_tracker_sample *sample)
{
	row->seq = sample->seq;
	row->t_ns = t_ns;
	row->n = 0;
	put_integer(row, sample->seq);
	put_integer(row, t_ns);
	put_integer(row, sample->t_ns);
	for (int i = 0; i < 3; i++)
		put_real(row, sample->position_mm[i]);
	for (int i = 0; i < 4; i++)
		put_real(row, sample->quaternion[i]);
	row->bytes[row->n++] = sample->status;
	put_integer(row, sample->station);
	put_integer(row, sample->button);
}

void incise_ledger_row_frame(struct incise_ledger_row *row,
			     const struct incise_frame_record *record)
{
	row->seq = record->seq;
	row->t_ns = record->t_ns;
	row->n = 0;
	put_integer(row, record->seq);
	put_integer(row, record->t_ns);
	put_integer(row, record->arrival_ns);
	put_integer(row, record->pts_ms);
	put_integer(row, record->bytes);
	put_integer(row, record->crc);
	put_real(row, record->length_px);
	put_real(row, record->sd_px);
	put_real(row, record->depth_mm);
	put_real(row, record->quality);
}

bool incise_ledger_row_read(struct incise_ledger_row *row,
			    const struct incise_ledger_form *form, sqlite3_stmt *stmt)
{
	row->n = 0;
	row->seq = sqlite3_column_int64(stmt, 0);
	row->t_ns = sqlite3_column_int64(stmt, 1);
	for (int i = 0; form->types[i]; i++) {
		int type = sqlite3_column_type(stmt, i);

		switch (form->types[i]) {
		case 'i':
			if (type != SQLITE_INTEGER)
				return false;
			put_integer(row, sqlite3_column_int64(stmt, i));
			break;
		case 'n':
			if (type == SQLITE_NULL) {
				put_real(row, NAN);
				break;
			}
			/* fall through */
		case 'r':
			if (type != SQLITE_FLOAT)
				return false;
			put_real(row, sqlite3_column_double(stmt, i));
			break;
		case 'c':
			if (type != SQLITE_TEXT || !sqlite3_column_text(stmt, i) ||
			    sqlite3_column_bytes(stmt, i) != 1)
				return false;
			row->bytes[row->n++] = *sqlite3_column_text(stmt, i);
			break;
		}
	}
	return true;
}

/* --- blocks ------------------------------------------------------------------------ */

void incise_ledger_init(struct incise_ledger *ledger)
{
	*ledger = (struct incise_ledger){.last_seq = -1};
}

void incise_ledger_add(struct incise_ledger *ledger, const struct incise_ledger_row *row)
{
	struct incise_ledger_block *open = &ledger->open;

	if (!open->count) {
		open->first_seq = row->seq;
		open->first_ns = row->t_ns;
		open->lost = 0;
	}
	/* Unsigned: whatever a damaged row holds, the difference is defined. */
	if (ledger->begun)
		open->lost += (uint64_t)row->seq - (uint64_t)ledger->last_seq - 1;
	open->count++;
	open->crc = incise_crc32c(open->crc, row->bytes, row->n);
	ledger->begun = true;
	ledger->last_seq = row->seq;
	ledger->last_ns = row->t_ns;
}

void incise_ledger_seal_block(struct incise_ledger_block *block)
{
	uint8_t bytes[7 * 8], *to = bytes;

	to = put(to, block->block);
	to = put(to, block->first_seq);
	to = put(to, block->last_seq);
	to = put(to, block->first_ns);
	to = put(to, block->last_ns);
	to = put(to, block->count);
	put(to, block->lost);
	block->crc = incise_crc32c(block->crc, bytes, sizeof(bytes));
}

bool incise_ledger_same(const struct incise_ledger_block *a,
			const struct incise_ledger_block *b)
{
	return a->block == b->block && a->first_seq == b->first_seq &&
	       a->last_seq == b->last_seq && a->first_ns == b->first_ns &&
	       a->last_ns == b->last_ns && a->count == b->count && a->lost == b->lost &&
	       a->crc == b->crc;
}

/* The open block with its last fields; the next one goes on from its CRC. */
static void seal(struct incise_ledger *ledger, struct incise_ledger_block *block)
{
	struct incise_ledger_block *open = &ledger->open;

	incise_ledger_seal_block(open);
	*block = *open;
	ledger->lost += open->lost;
	open->block++;
	open->count = 0;
}

bool incise_ledger_end(struct incise_ledger *ledger, struct incise_ledger_block *block)
{
	if (!ledger->open.count)
		return false;
	ledger->open.last_seq = ledger->last_seq;
	ledger->open.last_ns = ledger->last_ns;
	seal(ledger, block);
	return true;
}

void incise_ledger_close(struct incise_ledger *ledger, uint64_t lost,
			 struct incise_ledger_block *block)
{
	struct incise_ledger_block *open = &ledger->open;

	open->first_seq = (uint64_t)ledger->last_seq + 1;
	open->last_seq = (uint64_t)ledger->last_seq + lost;
	open->first_ns = open->last_ns = ledger->last_ns;
	open->lost = lost;
	seal(ledger, block);
}
