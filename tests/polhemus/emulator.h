/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A tracker that is not there: commands in, replies and records out, in a time that its user
 * gives it. Written from the manuals, and independent of lib/device/polhemus, which it
 * tests. Strict: what is no command is answered with *ERROR*.
 *
 *   bytes of the host --> emulator_write()       emulator_advance() <-- time, ns
 *                               |                       |
 *                            replies                 records --> damage
 *                               '---- emulator_take() ----'
 *
 * It moves in a way that emulator_pose() shows, and keeps a list of all records that it
 * should have sent, and of what became of them.
 */
#ifndef INCISE_TEST_POLHEMUS_EMULATOR_H
#define INCISE_TEST_POLHEMUS_EMULATOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define EMULATOR_STATIONS 4
#define EMULATOR_ITEMS 32
#define EMULATOR_ROOM \
	8192 /* bytes of each kind that wait; more are lost, as in the device */

enum emulator_kind { EMULATOR_FASTRAK, EMULATOR_LIBERTY, EMULATOR_PATRIOT };

/* Damage to records on their way, in parts of a million, in slots from … to. */
struct emulator_damage {
	uint64_t from, to;
	unsigned int flip;   /* of bytes that become another one */
	unsigned int drop;   /* of bytes that vanish */
	unsigned int insert; /* of bytes that get another one before them */
	unsigned int lose;   /* of records that vanish as a whole */
};

struct emulator_sent {
	uint64_t slot; /* of its period, from 0 */
	int64_t t_ns;
	uint8_t station;
	bool touched; /* a byte of it came to harm, or all of it */
};

struct emulator_pose {
	float xyz_cm[3], q[4];
	char error; /* ' ': none */
	bool button;
};

struct emulator {
	enum emulator_kind kind;
	/* May be changed before it starts. */
	bool present[EMULATOR_STATIONS]; /* a sensor is plugged in */
	int switch_bytes;
	double hz; /* of its cycle */
	struct emulator_damage damage;
	uint64_t random;
	bool deaf;	   /* answers nothing */
	const char *stuck; /* commands that it takes and forgets: "Hu" */
	char flag;	   /* error character of each record; 0: as of its pose */
	bool frozen;	   /* records repeat the pose of @frozen_slot */
	uint64_t frozen_slot;

	/* What the host set. */
	bool binary, cm, continuous, mouse;
	bool on[EMULATOR_STATIONS];
	int items[EMULATOR_STATIONS][EMULATOR_ITEMS], n_items[EMULATOR_STATIONS];
	double hemisphere[EMULATOR_STATIONS][3], increment[EMULATOR_STATIONS];
	double filters[2][4];
	/* Origin, a point of +x and one of +y; angles of the transmitter and at a boresight; tip of a stylus. */
	double alignment[EMULATOR_STATIONS][9], mounting[EMULATOR_STATIONS][3];
	double boresight[EMULATOR_STATIONS][3], tip[EMULATOR_STATIONS][3];
	int boresights; /* that B has set */
	int sync, rate;
	int eeprom_writes, errors;

	char command[160];
	size_t n;
	int64_t start_ns, now_ns;
	uint64_t slot;	      /* the next */
	int turn;	      /* which of the stations is next */
	bool pressed, paused; /* its button; by it */

	unsigned char replies[EMULATOR_ROOM], records[EMULATOR_ROOM];
	size_t n_replies, n_records;
	struct emulator_sent *sent;
	size_t n_sent, capacity_sent;
};

void emulator_init(struct emulator *e, enum emulator_kind kind, int64_t now_ns);
void emulator_free(struct emulator *e);

void emulator_write(struct emulator *e, const void *bytes, size_t n);
void emulator_advance(struct emulator *e, int64_t now_ns);

/* When it will next send; INT64_MAX: never. */
int64_t emulator_next_ns(const struct emulator *e);

/* Take bytes that wait, replies first; or only records, or only replies. */
size_t emulator_take(struct emulator *e, void *bytes, size_t size);
size_t emulator_take_replies(struct emulator *e, void *bytes, size_t size);
size_t emulator_take_records(struct emulator *e, void *bytes, size_t size);

/* Where a station is in a period. */
struct emulator_pose emulator_pose(uint64_t slot, int station);

#endif
