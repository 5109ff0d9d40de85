// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A session against the criteria of its scene; see session.h.
 */
#include <math.h>
#include <stdio.h>
#include "session.h"

enum form { RANGE, MOST, SWITCH };

static const struct {
	const char *label, *head, *unit;
	enum form form;
	int digits;
	bool of_membrane; /* a scene without one has no value */
	bool of_contact;  /* nor has a session in which no tool touched the tissue */
} criteria[INCISE_CRITERIA] = {
	[INCISE_CRITERION_CUT_LENGTH] = {"length of the incision", "length_mm", "mm",
					 RANGE, 1, false},
	[INCISE_CRITERION_CUT_DEPTH] = {"depth of the incision", "depth_mm", "mm", RANGE,
					1, false},
	[INCISE_CRITERION_OFF_TARGET] = {"off the target", "off_mm", "mm", MOST, 1, true},
	[INCISE_CRITERION_INCISIONS] = {"incisions", "incisions", "", MOST, 0, false,
					true},
	[INCISE_CRITERION_MEMBRANE] = {"through the membrane", "membrane", "", SWITCH, 0,
				       true},
	[INCISE_CRITERION_INSERTION] = {"depth of the tube", "tube_mm", "mm", RANGE, 1,
					false},
	[INCISE_CRITERION_BACK_WALL] = {"back wall touched", "back_wall", "", SWITCH, 0,
					true, true},
	[INCISE_CRITERION_FORCE] = {"largest force", "force_N", "N", MOST, 2, false,
				    true},
	[INCISE_CRITERION_TIME] = {"time needed", "time_s", "s", MOST, 1, false, true},
};

const char *session_criterion_label(int criterion)
{
	return criteria[criterion].label;
}

const char *session_criterion_head(int criterion)
{
	return criteria[criterion].head;
}

const char *session_criterion_unit(int criterion)
{
	return criteria[criterion].unit;
}

double session_rounded(double value, int digits)
{
	double factor = pow(10, digits);

	return round(value * factor) / factor + 0.0;
}

double session_criterion_difference(int criterion, double value, double reference)
{
	if (criteria[criterion].form == SWITCH)
		return NAN;
	return value - reference;
}

void session_criterion_value(int criterion, double value, char *text, size_t size)
{
	if (isnan(value))
		snprintf(text, size, "-");
	else if (criteria[criterion].form == SWITCH)
		snprintf(text, size, "%s", value != 0 ? "yes" : "no");
	else
		snprintf(text, size, "%.*f", criteria[criterion].digits,
			 session_rounded(value, criteria[criterion].digits));
}

void session_criterion_asked(int criterion, const struct incise_scene_criterion *asked,
			     char *text, size_t size)
{
	enum form form = criteria[criterion].form;

	if (!asked->asked)
		snprintf(text, size, "-");
	else if (form == SWITCH)
		snprintf(text, size, "%s", asked->max != 0 ? "yes" : "no");
	else if (form == MOST)
		snprintf(text, size, "at most %g", asked->max);
	else
		snprintf(text, size, "%g to %g", asked->min, asked->max);
}

static double apart_mm(const double a[3], const double b[3])
{
	return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
		    (a[2] - b[2]) * (a[2] - b[2]));
}

/* Largest distance of an end of one cut from an end of the other cut, or of its own. */
static double reach_mm(const struct session_cut *a, const struct session_cut *b)
{
	return fmax(fmax(apart_mm(a->from_mm, b->from_mm),
			 apart_mm(a->from_mm, b->to_mm)),
		    fmax(apart_mm(a->to_mm, b->from_mm), apart_mm(a->to_mm, b->to_mm)));
}

/* From end to end, whatever crosses it. @first: number of its first cut */
static double length_of(const struct session *session, int first)
{
	const struct session_cut *cut = session->cut;
	double length_mm = 0;

	for (int i = first; i < session->n_cuts; i++)
		for (int k = i; cut[i].incision == first && k < session->n_cuts; k++)
			if (cut[k].incision == first)
				length_mm = fmax(length_mm, reach_mm(&cut[i], &cut[k]));
	return length_mm;
}

/* The longest incision, by the number of its first cut; -1: no incision. @n: how many there are */
static int longest(const struct session *session, double *length_mm, int *n)
{
	int best = -1;

	*n = 0;
	*length_mm = 0;
	for (int i = 0; i < session->n_cuts; i++) {
		double here_mm;

		if (session->cut[i].incision != i)
			continue;
		++*n;
		here_mm = length_of(session, i);
		if (best >= 0 && here_mm <= *length_mm)
			continue;
		best = i;
		*length_mm = here_mm;
	}
	return best;
}

static void see_incisions(const struct session *session,
			  struct session_verdict verdicts[INCISE_CRITERIA])
{
	double length_mm, depth_mm = 0, off_mm = NAN;
	int n, best = longest(session, &length_mm, &n);

	for (int i = 0; i < session->n_cuts; i++)
		if (session->cut[i].incision == best) {
			depth_mm = fmax(depth_mm, session->cut[i].depth_mm);
			off_mm = fmin(off_mm, session->cut[i].off_target_mm);
		}
	verdicts[INCISE_CRITERION_CUT_LENGTH].value = length_mm;
	verdicts[INCISE_CRITERION_CUT_DEPTH].value = depth_mm;
	verdicts[INCISE_CRITERION_OFF_TARGET].value = off_mm;
	verdicts[INCISE_CRITERION_INCISIONS].value = n;
}

/* A time ends with the tube in place, where the scene asks for one. */
static bool has_time(const struct session *session)
{
	return !session->criteria[INCISE_CRITERION_INSERTION].asked ||
	       !isnan(session->insertion.placed_s);
}

void session_judge(const struct session *session,
		   struct session_verdict verdicts[INCISE_CRITERIA])
{
	see_incisions(session, verdicts);
	verdicts[INCISE_CRITERION_MEMBRANE].value = session->target.punctured;
	verdicts[INCISE_CRITERION_INSERTION].value = session->insertion.seated_mm;
	verdicts[INCISE_CRITERION_BACK_WALL].value = session->back_wall.touched > 0;
	verdicts[INCISE_CRITERION_FORCE].value = session->force.largest_N;
	verdicts[INCISE_CRITERION_TIME].value = session->needed_s;
	for (int i = 0; i < INCISE_CRITERIA; i++) {
		struct session_verdict *verdict = &verdicts[i];
		const struct incise_scene_criterion *asked = &session->criteria[i];
		bool there = (session->has_membrane || !criteria[i].of_membrane) &&
			     (!isnan(session->first_s) || !criteria[i].of_contact) &&
			     (i != INCISE_CRITERION_TIME || has_time(session));

		if (!there)
			verdict->value = NAN;
		verdict->judged = asked->asked && there;
		verdict->met = verdict->judged && verdict->value >= asked->min &&
			       verdict->value <= asked->max;
	}
}
