// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The flags of poses: which of them make a pose unusable, and their meaning.
 *
 * Letters are the maker's: of a FASTRAK by its user manual, rev. G (2012), page 71; of LIBERTY
 * and PATRIOT as public drivers list them, after the maker's "Error Code Summary". Where models
 * differ in the meaning of a letter, its text holds for each. A letter that is not in the table
 * is of a self-test that failed, or unknown: its pose is not used.
 */
#include <stdio.h>
#include <incise/tracker.h>

static const struct {
	char first, last;
	bool usable;
	const char *text;
} flags[] = {
	{'!', '!', false, "its sender does not see it, or is not ready"},
	{'=', '=', false, "the same pose for too long: the sensor does not measure"},
	{'A', 'G', false, "its source or a self-test failed"},
	{'a', 'g', false, "its source or its self-calibration failed"},
	{'j', 'j', false, "signal too strong: the sensor is too near"},
	{'k', 'l', false, "signal too weak: the sensor is too far away, or unplugged"},
	{'m', 'm', true, "its memory of settings is damaged"},
	{'s', 's', false, "its search for the position was restarted"},
	{'t', 't', true, "its map of the distortion by metal is damaged"},
	{'u', 'u', true, "outside its map of the distortion by metal"},
	{'v', 'v', true, "no video sync"},
	{'w', 'w', true, "its settings could not be stored"},
	{'x', 'x', false, "the sensor is outside its motion box"},
	{'y', 'y', false, "the attitude is outside its envelope"},
	{'~', '~', false, "not a pose: no rotation, or not finite"},
};

static int find_pose_flags(char status)
{
	for (int i = 0; i < (int)(sizeof(flags) / sizeof(*flags)); i++)
		if (status >= flags[i].first && status <= flags[i].last)
			return i;
	return -1;
}

static bool is_flag(char status)
{
	return status && status != ' ';
}

bool incise_pose_usable(char status)
{
	int at = is_flag(status) ? find_pose_flags(status) : -1;

	return !is_flag(status) || (at >= 0 && flags[at].usable);
}

const char *incise_pose_flag(char status)
{
	int at = find_pose_flags(status);

	if (!is_flag(status))
		return "no flag";
	return at >= 0 ? flags[at].text : "its self-test found an error";
}

bool incise_pose_count(struct incise_pose_counts *counts, char status)
{
	bool usable = incise_pose_usable(status);

	counts->poses++;
	counts->unusable += !usable;
	if (is_flag(status))
		counts->flagged[status > ' ' && status <= '~' ? (int)status : '?']++;
	return usable;
}

void incise_pose_counts_add(struct incise_pose_counts *counts,
			    const struct incise_pose_counts *more)
{
	counts->poses += more->poses;
	counts->unusable += more->unusable;
	for (int flag = 0; flag < 128; flag++)
		counts->flagged[flag] += more->flagged[flag];
}

/* Append the flags that are usable, or those that are not, each with its meaning. */
static int list_pose_flags(const struct incise_pose_counts *counts, bool usable,
			   char *text, size_t size, int n)
{
	const char *before = "";

	for (int flag = 0; flag < 128; flag++) {
		size_t at = (size_t)n < size ? (size_t)n : size;

		if (!counts->flagged[flag] || incise_pose_usable((char)flag) != usable)
			continue;
		n += snprintf(text + at, size - at, "%s%llu '%c' (%s)", before,
			      (unsigned long long)counts->flagged[flag], flag,
			      incise_pose_flag((char)flag));
		before = ", ";
	}
	return n;
}

int incise_pose_counts_text(const struct incise_pose_counts *counts, char *text,
			    size_t size)
{
	uint64_t doubtful = 0;
	size_t at;
	int n = 0;

	for (int flag = 0; flag < 128; flag++)
		doubtful += incise_pose_usable((char)flag) ? counts->flagged[flag] : 0;
	if (size)
		*text = '\0';
	if (counts->unusable) {
		n = snprintf(text, size, "%llu of %llu poses were not used: ",
			     (unsigned long long)counts->unusable,
			     (unsigned long long)counts->poses);
		n = list_pose_flags(counts, false, text, size, n);
	}
	if (!doubtful)
		return n;
	at = (size_t)n < size ? (size_t)n : size;
	n += snprintf(text + at, size - at,
		      "%s%llu of %llu poses are doubtful: ", n ? "; " : "",
		      (unsigned long long)doubtful, (unsigned long long)counts->poses);
	return list_pose_flags(counts, true, text, size, n);
}
