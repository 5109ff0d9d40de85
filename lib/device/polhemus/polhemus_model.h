/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The known trackers of Polhemus: their ids on USB, rates and latencies.
 *
 * A tracker starts without firmware; a loader sends it each time it is plugged in, and it
 * then appears again as another product. (From the maker's user manuals and Linux tools;
 * see rig.conf(5).)
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
	bool ready; /* false: waits for its firmware */
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
