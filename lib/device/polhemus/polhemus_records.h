/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Records in the stream of bytes that a Polhemus tracker sends, as polhemus_setup.c asks for
 * them. Positions are in mm when they leave here; the device sends cm.
 *
 *   FASTRAK, items 2,11,16,1, binary            ASCII
 *   '0' station error                           '0' station error
 *   x y z          float32, little-endian       3 × Sxxx.xx
 *   q0 q1 q2 q3    float32                      4 × Sx.xxxx
 *   switch         1, 2 or 4 bytes, measured    1 or 2 characters
 *   CR LF                                       CR LF
 *
 *   LIBERTY, PATRIOT, items 2,7,9,10, binary
 *   'L' 'Y' (or 'P' 'A') station command error reserved u16 length of what follows
 *   x y z q0 q1 q2 q3 float32, count of frames u32, switch i32
 *
 * No record of a FASTRAK has a checksum, a timestamp or a counter, and every byte of a header is
 * legal inside a float. So a record is believed when all of it holds: the header, the
 * sentinel at its distance, a quaternion of length 1, a position in the room, a switch that
 * is a switch. Where it does not, the search goes on one byte further: damage costs the
 * records that it touches. Damage that leaves a position in the room is not seen; no program can
 * see it.
 */
#ifndef INCISE_POLHEMUS_RECORDS_H
#define INCISE_POLHEMUS_RECORDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include "polhemus_model.h"

#define POLHEMUS_RECORD_MAX 64 /* bytes; the longest is 56 */

/* Farther from the source nothing is measured: the long-range one reaches 4.6 m. */
#define POLHEMUS_ROOM_MM 6000

/* Largest deviation of a quaternion's norm from 1: ASCII has four digits, and the device
 * calibrates its own. */
#define POLHEMUS_UNIT 0.01

struct polhemus_layout {
	enum polhemus_family family;
	bool ascii;	      /* FASTRAK only */
	uint8_t stations;     /* bit 0 is station 1 */
	uint8_t switch_bytes; /* FASTRAK: 1, 2, 4; ASCII 1, 2 */
};

struct polhemus_record {
	int64_t t_ns; /* when its last byte came */
	double position_mm[3];
	double quaternion[4];
	uint32_t frame; /* LIBERTY, PATRIOT: counts; else 0 */
	char status;	/* ' ': all is well */
	uint8_t station;
	bool button;
	unsigned int skipped; /* bytes before it that were no record */
};

struct polhemus_records {
	struct polhemus_layout layout;
	unsigned int n, skipped;
	unsigned char bytes[4 * POLHEMUS_RECORD_MAX];
	int64_t t_ns[4 * POLHEMUS_RECORD_MAX]; /* of each byte */
};

/* Numbers as all of them send it: low byte first, reals as IEEE singles. */
uint32_t polhemus_word(const unsigned char *bytes);
double polhemus_real(const unsigned char *bytes);

/* Bytes of a record; 0: there is no such layout. */
size_t polhemus_layout_length(const struct polhemus_layout *layout);

/* Take one record at @bytes, which are polhemus_layout_length(); false unless all of it holds. */
bool polhemus_record_read(const struct polhemus_layout *layout,
			  const unsigned char *bytes, struct polhemus_record *record);

void polhemus_records_init(struct polhemus_records *records,
			   const struct polhemus_layout *layout);

/*
 * Bytes that came at @t_ns. Returns how many of them were taken: all, if polhemus_records_next()
 * was called until it returned false, and @n is at most POLHEMUS_RECORD_MAX.
 */
size_t polhemus_records_put(struct polhemus_records *records, const unsigned char *bytes,
			    size_t n, int64_t t_ns);

/* The next record; false: more bytes are needed. */
bool polhemus_records_next(struct polhemus_records *records,
			   struct polhemus_record *record);

#endif
