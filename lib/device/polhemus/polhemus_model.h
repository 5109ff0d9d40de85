/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The trackers of Polhemus that are known: how they show on USB and how fast they are.
 *
 * A tracker comes out of its box without firmware; a loader gives it that each time it is
 * plugged in, and it then appears once more, as another product. (From the maker's user
 * manuals and Linux tools; see the facts in the manual page of rig.conf.)
 */
#ifndef INCISE_POLHEMUS_MODEL_H
#define INCISE_POLHEMUS_MODEL_H

#include <stdbool.h>
#include <stdint.h>

#define POLHEMUS_VENDOR 0x0f44
#define POLHEMUS_STATIONS 4 /* as many as struct incise_tracker_setup has */

enum polhemus_family {
	POLHEMUS_FASTRAK,
	POLHEMUS_LIBERTY,
	POLHEMUS_PATRIOT,
};

struct polhemus_model {
	uint16_t product;
	bool ready; /* false: it waits for its firmware */
	enum polhemus_family family;
	const char *name;
};

/* NULL: not known. */
const struct polhemus_model *polhemus_model_find(uint16_t vendor, uint16_t product);

const char *polhemus_family_name(enum polhemus_family family);

/* Records of all @stations together, per second: FASTRAK shares 120 Hz among them. */
double polhemus_family_hz(enum polhemus_family family, int stations);

/* Middle of the measurement to the first byte, by the data sheets, ns. */
int64_t polhemus_family_latency_ns(enum polhemus_family family);

#endif
