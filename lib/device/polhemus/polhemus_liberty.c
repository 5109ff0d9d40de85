// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Setting up a LIBERTY or PATRIOT; see polhemus_setup.h. They speak in frames once F1 is set,
 * and their numbers are 32 bits long, as a float or an integer, little-endian. Items 2 xyz, 7
 * quaternion, 9 count of frames, 10 stylus. (LIBERTY user manual, rev. H; PATRIOT, rev. J.)
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "polhemus_family.h"

#define NEAR 0.02

enum { CONTROL_U = 'U' & 31, CONTROL_V = 'V' & 31 };

int polhemus_liberty_identify(struct polhemus_dialogue *d,
			      struct polhemus_identity *identity)
{
	struct polhemus_frame frame;
	char text[48] = {0};
	size_t n = 0;
	/* The CR ends what was meant for a FASTRAK. What it says to that is still text. */
	int rc = polhemus_say(d, "\rF1\r");

	if (!rc)
		rc = polhemus_drain(d);
	if (rc == -EBUSY)
		return -ETIMEDOUT; /* what comes is no answer */
	if (!rc)
		rc = polhemus_ask_frame(d, "\026\r", CONTROL_V, &frame);
	if (rc)
		return rc;
	for (size_t i = 0; i < frame.n && n + 1 < sizeof(text); i++)
		if (frame.payload[i] > ' ' || (frame.payload[i] == ' ' && n))
			text[n++] =
				frame.payload[i] <= '~' ? (char)frame.payload[i] : '?';
	identity->layout.family = (enum polhemus_family)frame.family;
	identity->sensors = -1;
	snprintf(identity->name, sizeof(identity->name), "%s %s",
		 polhemus_family_name(identity->layout.family), text);
	return 0;
}

/* A command, a question, and the numbers that its answer begins with. */
static int put(struct polhemus_dialogue *d, const char *command, const char *question,
	       bool reals, const double *values, int n, const char *what)
{
	struct polhemus_frame frame;
	int rc = polhemus_say(d, command);

	if (!rc)
		rc = polhemus_ask_frame(d, question, (unsigned char)question[0], &frame);
	if (rc)
		return rc == -ETIMEDOUT ? polhemus_not_taken(d, what, "") : rc;
	for (int i = 0; i < n; i++) {
		const unsigned char *at = frame.payload + (size_t)i * 4;
		double got;

		if (frame.n < (size_t)(i + 1) * 4)
			return polhemus_not_taken(d, what, "a short answer");
		got = reals ? polhemus_real(at) : (double)polhemus_word(at);
		if (!(fabs(got - values[i]) <= NEAR))
			return polhemus_not_taken(d, what, "something else");
	}
	return 0;
}

/* Detected and active, bit by bit, as 16 or as 32 bits each. */
static int switch_stations(struct polhemus_dialogue *d, uint8_t mask)
{
	struct polhemus_frame frame;
	char command[12];
	uint32_t active;
	int rc = 0;

	for (int on = 1; on >= 0; on--)
		for (int i = 0; !rc && i < POLHEMUS_STATIONS; i++) {
			/* A PATRIOT has two stations, and refuses others. */
			if ((mask >> i & 1) != on)
				continue;
			snprintf(command, sizeof(command), "\025%d,%d\r", i + 1, on);
			if (on)
				rc = polhemus_say(d, command);
			else if (!(rc = polhemus_say(d, command)))
				rc = polhemus_drain(d);
		}
	if (rc == -EBUSY)
		return polhemus_not_taken(d, "its stations", "more and more");
	if (!rc)
		rc = polhemus_ask_frame(d, "\0250\r", CONTROL_U, &frame);
	if (rc)
		return rc == -ETIMEDOUT ? polhemus_not_taken(d, "its stations", "") : rc;
	if (frame.n < 4)
		return polhemus_not_taken(d, "its stations", "a short answer");
	active = frame.n >= 8 ? polhemus_word(frame.payload + 4)
			      : polhemus_word(frame.payload) >> 16;
	if ((active & 0xf) == mask)
		return 0;
	return incise_error_set(
		d->err, EIO,
		"%s: the tracker at %s has stations %#x active, not %#x: plug "
		"its sensors in, or change tracker_setup",
		d->where, d->line->name, (unsigned int)active, mask);
}

int polhemus_liberty_setup(struct polhemus_dialogue *d,
			   const struct incise_tracker_setup *setup,
			   struct polhemus_identity *identity)
{
	static const double one[] = {1}, fastest[] = {4}, unfiltered[] = {0, 1, 0, 0};
	char command[64], question[8];
	int rc = polhemus_liberty_identify(d, identity);
	bool liberty;

	if (rc)
		return rc;
	if (setup->sync != INCISE_TRACKER_INTERNAL)
		return incise_error_set(
			d->err, EINVAL,
			"%s: sync from outside is only known of a FASTRAK: "
			"set sync = \"internal\" in tracker_setup",
			d->where);
	liberty = identity->layout.family == POLHEMUS_LIBERTY;
	rc = put(d, "U1\r", "U\r", false, one, 1, "centimetres");
	if (!rc && liberty)
		rc = put(d, "R4\r", "R\r", false, fastest, 1, "240 Hz");
	if (!rc)
		rc = switch_stations(d, polhemus_mask(setup));
	for (int i = 0; !rc && i < setup->n_stations; i++) {
		int station = setup->stations[i];

		snprintf(command, sizeof(command), "O%d,2,7,9,10\rL%d,0\r", station,
			 station);
		rc = polhemus_say(d, command);
		snprintf(command, sizeof(command), "H%d,%.4f,%.4f,%.4f\r", station,
			 setup->hemisphere[0], setup->hemisphere[1],
			 setup->hemisphere[2]);
		snprintf(question, sizeof(question), "H%d\r", station);
		if (!rc)
			rc = put(d, command, question, true, setup->hemisphere, 3,
				 "its hemisphere");
	}
	if (!rc)
		rc = put(d, "X0,1,0,0\r", "X\r", true, unfiltered, 4,
			 "no position filter");
	if (!rc)
		rc = put(d, "Y0,1,0,0\r", "Y\r", true, unfiltered, 4,
			 "no attitude filter");
	if (rc)
		return rc;
	identity->layout.stations = polhemus_mask(setup);
	rc = polhemus_measure(d, setup, &identity->layout);
	return rc ? rc : polhemus_say(d, "C\r");
}
