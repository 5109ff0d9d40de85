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
