// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Sets a tracker up, reads it back, starts and stops it; see polhemus_setup.h.
 */
#include <errno.h>
#include <string.h>
#include "polhemus_family.h"

#define STOPS 10

static int no_answer(struct polhemus_dialogue *d)
{
	return incise_error_set(
		d->err, ETIMEDOUT,
		"%s: no tracker answers at %s: is it on, is the baud rate what "
		"its switches say, and the cable a null modem?",
		d->where, d->line->name);
}

/*
 * An end to whatever flows. A CR ends half a command; c the stream of a FASTRAK; P that of the
 * others, where c and CR begin one, while a FASTRAK answers it with records. What they say
 * to the rest is thrown away.
 */
static int quiet(struct polhemus_dialogue *d)
{
	const char *stop = d->line->family == POLHEMUS_FASTRAK ? "\rc"
			   : d->line->family >= 0	       ? "\rP"
							       : "\rc\rP";
	int rc = -EBUSY;

	/* Again and again: one that was just switched on did not hear the first. */
	for (int i = 0; rc == -EBUSY && i < STOPS; i++) {
		rc = polhemus_say(d, stop);
		if (!rc)
			rc = polhemus_drain(d);
	}
	if (rc == -EBUSY)
		incise_error_set(d->err, EBUSY,
				 "%s: the device at %s does not stop sending: is it a "
				 "Polhemus tracker, and the baud rate its own?",
				 d->where, d->line->name);
	return rc;
}

/* Which family it is, where the line does not tell. */
static int find_family(struct polhemus_dialogue *d, struct polhemus_identity *identity)
{
	int rc = d->line->family;

	if (rc >= 0) {
		identity->layout.family = (enum polhemus_family)rc;
		return 0;
	}
	identity->layout.family = POLHEMUS_FASTRAK;
	rc = polhemus_fastrak_identify(d, identity);
	if (rc != -ETIMEDOUT && rc != -EINVAL)
		return rc;
	return polhemus_liberty_identify(d, identity);
}

/* The bytes @d has are one record of each station, in their order. */
static bool fits(const struct polhemus_dialogue *d,
		 const struct incise_tracker_setup *setup,
		 const struct polhemus_layout *layout, int total)
{
	size_t length = polhemus_layout_length(layout);
	struct polhemus_record record;

	if (total != (int)length * setup->n_stations)
		return false;
	for (int i = 0; i < setup->n_stations; i++)
		if (!polhemus_record_read(layout, d->bytes + (size_t)i * length,
					  &record) ||
		    record.station != setup->stations[i])
			return false;
	return true;
}

/* How long a FASTRAK's switch is the manual does not say. */
int polhemus_measure(struct polhemus_dialogue *d,
		     const struct incise_tracker_setup *setup,
		     struct polhemus_layout *layout)
{
	static const uint8_t lengths[] = {1, 2, 4};
	int rc = polhemus_say(d, "P"), total;

	if (rc)
		return rc;
	total = polhemus_collect(d);
	if (total < 0)
		return total;
	for (size_t i = 0; i < sizeof(lengths); i++) {
		layout->switch_bytes = lengths[i];
		if (fits(d, setup, layout, total))
			return 0;
	}
	return incise_error_set(
		d->err, EIO,
		"%s: the tracker at %s answers P with %d bytes that are not "
		"a record of each of its %d stations: check its sensors",
		d->where, d->line->name, total, setup->n_stations);
}

int polhemus_setup(struct polhemus_line *line, const struct incise_tracker_setup *setup,
		   struct polhemus_identity *identity, const char *where,
		   struct incise_error *err)
{
	struct polhemus_dialogue d = {.line = line, .where = where, .err = err};
	int rc = quiet(&d);

	memset(identity, 0, sizeof(*identity));
	if (!rc)
		rc = find_family(&d, identity);
	if (!rc && identity->layout.family == POLHEMUS_FASTRAK)
		rc = polhemus_fastrak_setup(&d, setup, identity);
	else if (!rc)
		rc = polhemus_liberty_setup(&d, setup, identity);
	return rc == -ETIMEDOUT ? no_answer(&d) : rc;
}

int polhemus_identify(struct polhemus_line *line, struct polhemus_identity *identity,
		      const char *where, struct incise_error *err)
{
	struct polhemus_dialogue d = {.line = line, .where = where, .err = err};
	int rc = quiet(&d);

	memset(identity, 0, sizeof(*identity));
	if (!rc)
		rc = find_family(&d, identity);
	return rc == -ETIMEDOUT ? no_answer(&d) : rc;
}

void polhemus_stop(struct polhemus_line *line, enum polhemus_family family)
{
	struct polhemus_dialogue d = {.line = line, .where = ""};

	if (!polhemus_say(&d, family == POLHEMUS_FASTRAK ? "c" : "P"))
		polhemus_drain(&d);
}
