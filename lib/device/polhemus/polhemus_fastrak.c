// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Setting up a FASTRAK; see polhemus_setup.h and, for each command, chapter 9 of its manual.
 * All is asked back in ASCII; only then come binary records.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "polhemus_family.h"

#define NEAR 0.02 /* what it prints has two to four digits behind the point */

static const int items[] = {2, 11, 16, 1};
#define ITEMS ((int)(sizeof(items) / sizeof(*items)))

int polhemus_fastrak_identify(struct polhemus_dialogue *d,
			      struct polhemus_identity *identity)
{
	struct polhemus_status status;
	int rc = polhemus_ask_status(d, &status);

	if (rc)
		return rc;
	identity->sensors = status.sensors;
	identity->test_error = status.test_error;
	snprintf(identity->version, sizeof(identity->version), "%s", status.version);
	snprintf(identity->name, sizeof(identity->name), "FASTRAK %s %s", status.version,
		 status.id);
	return 0;
}

/* A command, a question, and what its answer must be; @width: of a field, or 0. */
static int put(struct polhemus_dialogue *d, const char *command, const char *question,
	       int width, const double *values, int n, const char *what)
{
	char reply[POLHEMUS_REPLY_MAX];
	double got[8] = {0};
	int fields[8] = {0}, m, rc = polhemus_say(d, command);

	if (!rc)
		rc = polhemus_ask(d, question, question[0], reply);
	if (rc == -ETIMEDOUT)
		return polhemus_not_taken(d, what, "");
	if (rc)
		return rc;
	if (width) {
		m = polhemus_reply_fields(reply, width, fields, 8);
		for (int i = 0; i < m; i++)
			got[i] = fields[i];
	} else {
		m = polhemus_reply_numbers(reply, got, 8);
	}
	for (int i = 0; i < n; i++)
		if (m < n || !(fabs(got[i] - values[i]) <= NEAR))
			return polhemus_not_taken(d, what, reply);
	/* More items than asked for would be longer records. */
	return width == 2 && m != n ? polhemus_not_taken(d, what, reply) : 0;
}

/* Those that are to be on first: the last one cannot be switched off. */
static int switch_stations(struct polhemus_dialogue *d, uint8_t mask)
{
	char reply[POLHEMUS_REPLY_MAX], command[8];
	int fields[POLHEMUS_STATIONS], rc = 0;

	for (int on = 1; on >= 0; on--)
		for (int i = 0; !rc && i < POLHEMUS_STATIONS; i++)
			if ((mask >> i & 1) == on) {
				snprintf(command, sizeof(command), "l%d,%d\r", i + 1, on);
				rc = polhemus_say(d, command);
			}
	if (!rc)
		rc = polhemus_ask(d, "l1\r", 'l', reply);
	if (rc)
		return rc == -ETIMEDOUT ? polhemus_not_taken(d, "its stations", "") : rc;
	if (polhemus_reply_fields(reply, 1, fields, POLHEMUS_STATIONS) !=
	    POLHEMUS_STATIONS)
		return polhemus_not_taken(d, "its stations", reply);
	for (int i = 0; i < POLHEMUS_STATIONS; i++) {
		if (fields[i] == (mask >> i & 1))
			continue;
		if (fields[i])
			return polhemus_not_taken(d, "its stations", reply);
		return incise_error_set(
			d->err, EIO,
			"%s: station %d of the tracker at %s does not "
			"switch on: plug its sensor in and set its switch, or "
			"leave it out of tracker_setup",
			d->where, i + 1, d->line->name);
	}
	return 0;
}

static int set_station(struct polhemus_dialogue *d, int station,
		       const double hemisphere[3])
{
	static const double still[] = {0};
	char command[64], question[8];
	double list[ITEMS];
	int rc;

	for (int i = 0; i < ITEMS; i++)
		list[i] = items[i];
	snprintf(command, sizeof(command), "O%d,2,11,16,1\r", station);
	snprintf(question, sizeof(question), "O%d\r", station);
	rc = put(d, command, question, 2, list, ITEMS, "its list of items");
	if (rc)
		return rc;
	snprintf(command, sizeof(command), "I%d,0\r", station);
	snprintf(question, sizeof(question), "I%d\r", station);
	rc = put(d, command, question, 0, still, 1, "an increment of 0");
	if (rc)
		return rc;
	snprintf(command, sizeof(command), "H%d,%.4f,%.4f,%.4f\r", station, hemisphere[0],
		 hemisphere[1], hemisphere[2]);
	snprintf(question, sizeof(question), "H%d\r", station);
	return put(d, command, question, 0, hemisphere, 3, "its hemisphere");
}

static int set_sync(struct polhemus_dialogue *d, enum incise_tracker_sync sync)
{
	const double is[] = {(double)sync};
	char command[8];

	snprintf(command, sizeof(command), "y%d\r", (int)sync);
	return put(d, command, "y\r", 0, is, 1, "its sync mode");
}

int polhemus_fastrak_setup(struct polhemus_dialogue *d,
			   const struct incise_tracker_setup *setup,
			   struct polhemus_identity *identity)
{
	static const double unfiltered[] = {0, 1, 0, 0};
	struct polhemus_status status;
	int rc = polhemus_say(d, "Fu");

	if (!rc)
		rc = polhemus_fastrak_identify(d, identity);
	if (!rc)
		rc = switch_stations(d, polhemus_mask(setup));
	for (int i = 0; !rc && i < setup->n_stations; i++)
		rc = set_station(d, setup->stations[i], setup->hemisphere);
	if (!rc)
		rc = put(d, "x0,1,0,0\r", "x\r", 0, unfiltered, 4, "no position filter");
	if (!rc)
		rc = put(d, "v0,1,0,0\r", "v\r", 0, unfiltered, 4, "no attitude filter");
	/* Its own clock for now: without pulses it may not answer P. */
	if (!rc)
		rc = set_sync(d, INCISE_TRACKER_INTERNAL);
	/* Nothing tells what the button does; but a refusal would stand before the status. */
	if (!rc)
		rc = polhemus_say(d, "e1,0\rf");
	if (!rc)
		rc = polhemus_ask_status(d, &status);
	if (rc)
		return rc;
	if (!status.binary || !status.centimetres || status.continuous)
		return polhemus_not_taken(d,
					  !status.binary	? "binary output"
					  : !status.centimetres ? "centimetres"
								: "an end of its records",
					  "the status S");
	identity->layout = (struct polhemus_layout){.family = POLHEMUS_FASTRAK,
						    .stations = polhemus_mask(setup)};
	rc = polhemus_measure(d, setup, &identity->layout);
	if (!rc && setup->sync != INCISE_TRACKER_INTERNAL)
		rc = set_sync(d, setup->sync);
	return rc ? rc : polhemus_say(d, "C");
}
