// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Making a session of recordings; see incise/session.h.
 *
 *     a's clock ─ wall ─► TAI ─ first's wall, backwards ─► session
 *     a's clock ─ marks that the first recorded too ─────► session
 */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/fs.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/version.h>
#include <incise/wall.h>
#include "../frames.h"
#include "../ledger.h"
#include "../read/database.h"
#include "../read/session.h"
#include "../read/source.h"
#include "../schema.h"
#include "../verify/seal_walk.h"
#include "align.h"

#define NS_PER_S 1000000000LL
#define KNOT_APART_NS 1000000LL /* closer knots say nothing more */

struct member {
	struct incise_recording *recording;
	struct incise_wall *wall; /* or NULL */
	char *identity;
	char name[64], host[64];
	char boot[80]; /* equal: one CLOCK_MONOTONIC */
	const char *method;
	int64_t first_ns, last_ns; /* of its rows, on its own clock */
	struct incise_session_map map;
	double bound_ns; /* the largest of the map */
	/* By a signal. */
	struct incise_mark marks[INCISE_MARKS_MAX];
	int n_marks;
	bool has_events; /* of the SYNC line */
	struct incise_align_fit fit;
	double agreement_ns, agreement_bound_ns;
};

struct join {
	const struct incise_session_options *options;
	struct member *members;
	int n;
	struct incise_error *err;
};

static void note_join(struct join *join, const char *fmt, ...) INCISE_PRINTF(2, 3);
static void note_join(struct join *join, const char *fmt, ...)
{
	char text[300];
	va_list args;

	if (!join->options->note)
		return;
	va_start(args, fmt);
	vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	join->options->note(join->options->context, text);
}

/* --- opening ------------------------------------------------------------------------- */

/* A name for a folder that no other member has. */
static void name_member(struct join *join, int at)
{
	struct member *member = &join->members[at];
	const char *name = member->recording->name;
	int same = 1;

	snprintf(member->name, sizeof(member->name), "%.55s", name);
	for (char *c = member->name; *c; c++)
		if ((unsigned char)*c <= ' ' || *c == 0x7f || strchr("/:=,*", *c) ||
		    ((unsigned char)*c == 0xc2 && (c[1] & 0xe0) == 0x80) ||
		    (c == member->name && *c == '.'))
			*c = '_';
	for (int i = 0; i < at; i++)
		same += !strncmp(join->members[i].recording->name, name, 55);
	if (same > 1)
		sprintf(member->name + strlen(member->name), "~%d", same);
}

/* A text of the recording's meta; empty if it has none. */
static void read_text(const struct member *member, const char *key, char *text,
		      size_t size)
{
	incise_seal_key(member->recording, key, text, size, NULL);
	for (char *c = text; *c; c++)
		if ((unsigned char)*c == 0xc2 && (c[1] & 0xe0) == 0x80)
			*c = '?';
}

/* First and last time of a member's rows. */
static int read_span(struct join *join, struct member *member)
{
	member->first_ns = INT64_MAX;
	member->last_ns = -1;
	for (int i = 0; i < INCISE_LEDGER_STREAMS; i++) {
		int64_t first, last;

		if (!incise_source_span(member->recording, incise_ledger_forms[i].table,
					&first, &last))
			continue;
		member->first_ns = first < member->first_ns ? first : member->first_ns;
		member->last_ns = last > member->last_ns ? last : member->last_ns;
	}
	if (member->last_ns < 0)
		return incise_error_set(join->err, ENODATA,
					"%s: has no rows; leave it out",
					member->recording->path);
	/* A line needs two points. */
	if (member->last_ns <= member->first_ns)
		member->last_ns = member->first_ns + 1;
	return 0;
}

static int open_member(struct join *join, const char *path)
{
	struct member *member = &join->members[join->n];
	struct incise_recording *recording =
		incise_recording_open_as(path, INCISE_RECORDING_ACTIVE, join->err);
	int rc;

	if (!recording)
		return -errno;
	member->recording = recording;
	member->agreement_ns = member->agreement_bound_ns = NAN;
	join->n++;
	if (recording->session)
		return incise_error_set(
			join->err, EINVAL,
			"%s: is a joined recording; give those in it, for "
			"example %s",
			path, recording->session->members[0]->path);
	if (!recording->meta.complete && incise_recording_is_written(recording->path))
		return incise_error_set(join->err, EBUSY,
					"%s: is being recorded; wait for its end",
					recording->path);
	member->identity = incise_session_identity(recording);
	if (!member->identity)
		return incise_error_set(join->err, EINVAL,
					"%s: has no ledger; `incise verify %s` says why",
					recording->path, recording->path);
	for (int i = 0; i < join->n - 1; i++)
		if (!strcmp(join->members[i].identity, member->identity))
			return incise_error_set(join->err, EINVAL,
						"%s and %s: the same recording; give it "
						"once",
						join->members[i].recording->path,
						recording->path);
	if (!recording->meta.complete)
		note_join(join, "%s: was interrupted; it is joined up to its last commit",
			  recording->path);
	name_member(join, join->n - 1);
	read_text(member, "host", member->host, sizeof(member->host));
	read_text(member, "boot", member->boot, sizeof(member->boot));
	rc = read_span(join, member);
	if (rc)
		return rc;
	member->wall = incise_recording_wall(recording, NULL);
	if (!member->wall && errno != ENODATA) {
		incise_recording_wall(recording, join->err);
		return -EINVAL;
	}
	return 0;
}

/* --- clocks -------------------------------------------------------------------------- */

/* The reference of all points, or NULL: they have several. */
static const char *reference_of(const struct incise_wall *wall)
{
	const struct incise_wall_point *points;
	size_t n = incise_wall_points(wall, &points);

	for (size_t i = 1; i < n; i++)
		if (strcmp(points[i].reference, points[0].reference))
			return NULL;
	return points[0].reference;
}

/* From where to where the first member's clock is known. */
static void find_ends(const struct member *first, int64_t ends_ns[2])
{
	const struct incise_wall_point *points;
	size_t n = incise_wall_points(first->wall, &points);

	ends_ns[0] = points[0].t_ns - INCISE_SESSION_FAR_NS;
	ends_ns[1] = points[n - 1].t_ns + INCISE_SESSION_FAR_NS;
}

/*
 * TAI to the first member's clock. Far from its points that clock is not known: there the session's
 * goes on as TAI does, so that a gap costs no accuracy.
 */
static int from_tai(const struct member *first, int64_t tai_ns, int64_t *to_ns,
		    int64_t *bound_ns)
{
	int64_t ends_ns[2], end_tai_ns;

	find_ends(first, ends_ns);
	for (int i = 0; i < 2; i++) {
		if (incise_wall_tai(first->wall, ends_ns[i], &end_tai_ns, bound_ns))
			return -ENODATA;
		if (i ? tai_ns > end_tai_ns : tai_ns < end_tai_ns) {
			*to_ns = ends_ns[i] + (tai_ns - end_tai_ns);
			return 0;
		}
	}
	return incise_wall_monotonic(first->wall, tai_ns, to_ns, bound_ns);
}

/* A time of a member on the first one's clock, by wall time. Returns 0 or -ENODATA. */
static int by_wall(const struct member *first, const struct member *member, int64_t t_ns,
		   int64_t *to_ns, double *bound_ns)
{
	int64_t tai_ns, member_ns, first_ns;

	if (incise_wall_tai(member->wall, t_ns, &tai_ns, &member_ns) ||
	    from_tai(first, tai_ns, to_ns, &first_ns))
		return -ENODATA;
	*bound_ns = member_ns == INCISE_WALL_UNKNOWN || first_ns == INCISE_WALL_UNKNOWN
			    ? INFINITY
			    : (double)member_ns + (double)first_ns;
	return 0;
}

static int add_time(struct join *join, int64_t **times, size_t *n, int64_t t_ns)
{
	int64_t *more = realloc(*times, (*n + 1) * sizeof(**times));

	if (!more)
		return incise_schema_no_memory(join->members[0].recording->path,
					       join->err);
	*times = more;
	more[(*n)++] = t_ns;
	return 0;
}

static int compare_times(const void *a, const void *b)
{
	int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;

	return (x > y) - (x < y);
}

/* Add the time of a member when the first one's clock is t_ns, if it lies in its recording. */
static int add_time_of(struct join *join, const struct member *member, int64_t t_ns,
		       int64_t **times, size_t *n)
{
	int64_t tai_ns, member_ns;

	if (incise_wall_tai(join->members[0].wall, t_ns, &tai_ns, NULL) ||
	    incise_wall_monotonic(member->wall, tai_ns, &member_ns, NULL) ||
	    member_ns <= member->first_ns || member_ns >= member->last_ns)
		return 0;
	return add_time(join, times, n, member_ns);
}

/* Where the map of a member needs knots: its ends, and the points of both clocks. */
static int find_times(struct join *join, const struct member *member, int64_t **times,
		      size_t *n)
{
	const struct member *first = &join->members[0];
	const struct incise_wall_point *points;
	size_t n_points = incise_wall_points(member->wall, &points);
	int64_t ends_ns[2];
	int rc = add_time(join, times, n, member->first_ns);

	for (size_t i = 0; i < n_points && !rc; i++)
		if (points[i].t_ns > member->first_ns && points[i].t_ns < member->last_ns)
			rc = add_time(join, times, n, points[i].t_ns);
	n_points = incise_wall_points(first->wall, &points);
	for (size_t i = 0; i < n_points && !rc; i++)
		rc = add_time_of(join, member, points[i].t_ns, times, n);
	find_ends(first, ends_ns);
	for (int i = 0; i < 2 && !rc; i++)
		rc = add_time_of(join, member, ends_ns[i], times, n);
	if (!rc)
		rc = add_time(join, times, n, member->last_ns);
	if (!rc)
		qsort(*times, *n, sizeof(**times), compare_times);
	return rc;
}

static int add_knot(struct join *join, struct member *member, int64_t t_ns, int64_t to_ns,
		    double bound_ns)
{
	struct incise_session_map *map = &member->map;
	struct incise_session_knot *knots =
		realloc(map->knots, (map->n + 1) * sizeof(*knots));

	if (!knots)
		return incise_schema_no_memory(member->recording->path, join->err);
	map->knots = knots;
	if (map->n && to_ns <= knots[map->n - 1].to_ns)
		return incise_error_set(
			join->err, ERANGE,
			"%s: its wall clock went back by %.6g s at %.3f s of "
			"CLOCK_MONOTONIC, so times are ambiguous; align by a signal "
			"(--align tap)",
			member->recording->path,
			(double)(knots[map->n - 1].to_ns - to_ns +
				 (t_ns - knots[map->n - 1].t_ns)) *
				1e-9,
			(double)t_ns * 1e-9);
	knots[map->n++] = (struct incise_session_knot){t_ns, to_ns, bound_ns};
	member->bound_ns = fmax(member->bound_ns, bound_ns);
	return 0;
}

/* Whether the wall clocks of a member and the first one can be compared; else says why not. */
static int comparable(struct join *join, const struct member *member)
{
	const struct member *const both[] = {&join->members[0], member};
	const char *references[2];

	for (int i = 0; i < 2; i++)
		if (!both[i]->wall)
			return incise_error_set(
				join->err, ENODATA,
				"%s: has no wall time; align by a signal that both "
				"recorded (--align tap)",
				both[i]->recording->path);
	for (int i = 0; i < 2; i++) {
		references[i] = reference_of(both[i]->wall);
		if (!references[i])
			return incise_error_set(
				join->err, ENODATA,
				"%s: its clock changed its reference meanwhile; align by a "
				"signal (--align tap)",
				both[i]->recording->path);
	}
	if (strcmp(references[0], references[1]))
		return incise_error_set(
			join->err, ENODATA,
			"%s and %s: their clocks have different references (%s and %s); "
			"align by a signal (--align tap)",
			both[0]->recording->path, both[1]->recording->path, references[0],
			references[1]);
	return 0;
}

/* Say which of the two clocks has no bound at a time of the member: the member's, else the first. */
static int unsynchronised(struct join *join, const struct member *member, int64_t t_ns)
{
	int64_t tai_ns, bound_ns = INCISE_WALL_UNKNOWN;

	incise_wall_tai(member->wall, t_ns, &tai_ns, &bound_ns);
	if (bound_ns != INCISE_WALL_UNKNOWN)
		member = &join->members[0];
	return incise_error_set(
		join->err, ENODATA,
		"%s: its clock was not synchronised, so its error is unknown; synchronise "
		"the machine (PTP, chrony), or align by a signal (--align tap)",
		member->recording->path);
}

static int map_by_wall(struct join *join, struct member *member)
{
	struct member *first = &join->members[0];
	int64_t *times = NULL, last_ns = INT64_MIN;
	size_t n = 0;
	int rc = comparable(join, member);

	if (!rc)
		rc = find_times(join, member, &times, &n);
	for (size_t i = 0; i < n && !rc; i++) {
		int64_t to_ns;
		double bound_ns;

		/* The last one is needed as it is. */
		if (i && i + 1 < n &&
		    (times[i] - last_ns < KNOT_APART_NS ||
		     times[n - 1] - times[i] < KNOT_APART_NS))
			continue;
		last_ns = times[i];
		if (by_wall(first, member, times[i], &to_ns, &bound_ns))
			rc = incise_error_set(
				join->err, ENODATA,
				"%s: has no wall time at %.3f s of CLOCK_MONOTONIC; align "
				"by a signal (--align tap)",
				member->recording->path, (double)times[i] * 1e-9);
		else if (isinf(bound_ns))
			rc = unsynchronised(join, member, times[i]);
		else
			rc = add_knot(join, member, times[i], to_ns, bound_ns);
	}
	free(times);
	member->method = "clocks";
	return rc;
}

/* --- signals ------------------------------------------------------------------------- */

/* The marks of a member: events of the line, or what is sudden in force or motion. */
static int read_marks(struct join *join, struct member *member)
{
	bool tap = join->options->align == INCISE_ALIGN_TAP;
	int n = 0;

	if (!tap)
		n = incise_align_marks(member->recording, INCISE_ALIGN_EVENTS,
				       member->marks, join->err);
	member->has_events = n > 0;
	/* A line that another machine has events of may be seen as steps here. */
	if (!n)
		n = incise_align_marks(member->recording, INCISE_ALIGN_TAP, member->marks,
				       join->err);
	if (n < 0)
		return n;
	member->n_marks = n;
	if (n)
		return 0;
	return incise_error_set(
		join->err, ENODATA,
		"%s: no %sno sudden change of force or motion; align by another signal, or "
		"without --align",
		member->recording->path,
		tap ? "tap found: " : "event of the SYNC line, and ");
}

/* Compare the time by the signal with that by the clocks, if they can be compared. */
static int compare(struct join *join, struct member *member)
{
	const struct member *first = &join->members[0];
	int64_t clock_ns, signal_ns;
	double clock_bound_ns, bound_ns;
	struct incise_error *err = join->err;
	int rc;

	join->err = NULL;
	rc = comparable(join, member);
	join->err = err;
	if (rc || by_wall(first, member, member->fit.at_ns, &clock_ns, &clock_bound_ns) ||
	    isinf(clock_bound_ns))
		return 0;
	signal_ns = incise_align_time(&member->fit, member->fit.at_ns, &bound_ns);
	member->agreement_ns = (double)(signal_ns - clock_ns);
	member->agreement_bound_ns = bound_ns + clock_bound_ns;
	if (fabs(member->agreement_ns) <= member->agreement_bound_ns)
		return 0;
	return incise_error_set(
		join->err, ERANGE,
		"%s: signal and clocks disagree by %.6g ms, and may by %.3g ms; one of them "
		"is wrong: look at both, and give --align or not",
		member->recording->path, member->agreement_ns * 1e-6,
		member->agreement_bound_ns * 1e-6);
}

static int map_by_signal(struct join *join, struct member *member)
{
	struct member *first = &join->members[0];
	struct incise_error why = {0};
	int64_t times[3];
	int rc = first->n_marks ? 0 : read_marks(join, first);

	if (!rc)
		rc = read_marks(join, member);
	if (rc)
		return rc;
	if (join->options->align == INCISE_ALIGN_EVENTS && !first->has_events &&
	    !member->has_events)
		return incise_error_set(
			join->err, ENODATA,
			"%s and %s: no event of the SYNC line; --align tap, "
			"or without --align",
			first->recording->path, member->recording->path);
	rc = incise_align_fit(first->marks, first->n_marks, member->marks,
			      member->n_marks, join->options->align, &member->fit, &why);
	if (rc)
		return incise_error_set(join->err, -rc, "%s and %s: %s",
					first->recording->path, member->recording->path,
					why.text);
	member->method = join->options->align == INCISE_ALIGN_TAP ? "tap" : "sync";
	rc = compare(join, member);
	times[0] = member->first_ns;
	times[1] = member->fit.at_ns;
	times[2] = member->last_ns;
	for (int i = 0; i < 3 && !rc; i++) {
		double bound_ns;
		int64_t to_ns = incise_align_time(&member->fit, times[i], &bound_ns);

		if (i == 1 && (times[1] <= times[0] || times[1] >= times[2]))
			continue;
		rc = add_knot(join, member, times[i], to_ns, bound_ns);
	}
	return rc;
}

/* With others beside, a session's clock is not CLOCK_MONOTONIC far from the first recording. */
static bool is_one_clock(const struct join *join)
{
	const char *boot = join->members[0].boot;

	for (int i = 1; i < join->n; i++)
		if (strcmp(join->members[i].boot, boot))
			return false;
	return boot[0];
}

static int map_clock(struct join *join, int at)
{
	struct member *member = &join->members[at];
	double within_ns = join->options->within_s * 1e9;
	int rc;

	if (!at || (is_one_clock(join) && join->options->align == INCISE_ALIGN_CLOCKS)) {
		member->method = at ? "same" : "first";
		rc = add_knot(join, member, member->first_ns, member->first_ns, 0);
		return rc ? rc
			  : add_knot(join, member, member->last_ns, member->last_ns, 0);
	}
	rc = join->options->align == INCISE_ALIGN_CLOCKS ? map_by_wall(join, member)
							 : map_by_signal(join, member);
	if (!rc && within_ns > 0 && member->bound_ns > within_ns)
		rc = incise_error_set(
			join->err, ERANGE,
			"%s: its times are uncertain by %.3g ms, and --tolerance asks for "
			"%.3g ms; allow more, or align by another signal",
			member->recording->path, member->bound_ns * 1e-6,
			within_ns * 1e-6);
	return rc;
}

/* --- writing ------------------------------------------------------------------------- */

/*
 * Clone, link or copy a file that exists; bit for bit. A link is the same file, which nothing changes
 * once it is complete; of a symbolic link it is one to its target. Returns 0 or -errno.
 */
static int bring(const char *from, const char *to, bool complete)
{
	int in = open(from, O_RDONLY | O_CLOEXEC), out, rc = 0;

	if (in < 0)
		return errno == ENOENT ? 0 : -errno;
	if (complete && !linkat(AT_FDCWD, from, AT_FDCWD, to, AT_SYMLINK_FOLLOW)) {
		close(in);
		return 0;
	}
	out = open(to, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
	if (out < 0) {
		rc = -errno;
	} else {
		if (ioctl(out, FICLONE, in))
			rc = incise_database_copy(in, out);
		if (!rc && fsync(out))
			rc = -errno;
		if (close(out) && !rc)
			rc = -errno;
	}
	close(in);
	return rc;
}

static const char *const files[] = {INCISE_SCHEMA_DB, INCISE_SCHEMA_DB "-wal",
				    INCISE_FRAMES_FILE};

/* A file of a member. Returns 0, also if there is none, or -errno. */
static int bring_file(const struct member *member, const char *own, const char *name,
		      bool complete)
{
	char *from = NULL, *to = NULL;
	int rc = -ENOMEM;

	if (asprintf(&from, "%s/%s", member->recording->path, name) < 0)
		from = NULL;
	else if (asprintf(&to, "%s/%s", own, name) < 0)
		to = NULL;
	else
		rc = bring(from, to, complete);
	free(from);
	free(to);
	return rc;
}

/*
 * The regular files of a folder in a member: its seal, and the calibrations that it got after its
 * capture. A recording may come from anybody: no link is followed. Returns 0 or -errno.
 */
static int bring_folder(const struct member *member, const char *own, const char *name)
{
	char path[PATH_MAX], file[sizeof(((struct dirent *)0)->d_name) + 20];
	struct dirent *entry;
	struct stat st;
	DIR *folder;
	int rc, fd;

	snprintf(path, sizeof(path), "%s/%s", member->recording->path, name);
	fd = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
	folder = fd < 0 ? NULL : fdopendir(fd);
	if (!folder)
		return errno == ENOENT ? 0 : -errno;
	snprintf(path, sizeof(path), "%s/%s", own, name);
	rc = mkdir(path, 0777) ? -errno : 0;
	while (!rc && (entry = readdir(folder))) {
		if (fstatat(fd, entry->d_name, &st, AT_SYMLINK_NOFOLLOW) ||
		    !S_ISREG(st.st_mode))
			continue;
		snprintf(file, sizeof(file), "%s/%s", name, entry->d_name);
		rc = bring_file(member, own, file, true);
	}
	closedir(folder);
	return rc;
}

static int bring_member(struct join *join, const struct member *member,
			const char *folder)
{
	char *own;
	int rc = 0;

	if (asprintf(&own, "%s/%s", folder, member->name) < 0)
		return incise_schema_no_memory(folder, join->err);
	if (mkdir(own, 0777))
		rc = -errno;
	for (size_t i = 0; i < sizeof(files) / sizeof(*files) && !rc; i++)
		rc = bring_file(member, own, files[i], member->recording->meta.complete);
	if (!rc)
		rc = bring_folder(member, own, "calibration");
	if (!rc)
		rc = bring_folder(member, own, "seal");
	if (!rc)
		rc = bring_folder(member, own, "seal-before");
	if (rc)
		rc = incise_error_set(join->err, -rc, "%s: cannot be written: %s", own,
				      strerror(-rc));
	free(own);
	return rc;
}

static int bind_known(sqlite3_stmt *stmt, int at, double value)
{
	return isnan(value) ? sqlite3_bind_null(stmt, at)
			    : sqlite3_bind_double(stmt, at, value);
}

/* The rows of a member in tables members and maps. Returns an SQLite code. */
static int put_member(const struct member *member, int at, sqlite3_stmt *members,
		      sqlite3_stmt *maps)
{
	int rc;

	sqlite3_bind_int(members, 1, at);
	sqlite3_bind_text(members, 2, member->name, -1, SQLITE_STATIC);
	sqlite3_bind_text(members, 3, member->host, -1, SQLITE_STATIC);
	sqlite3_bind_text(members, 4, member->method, -1, SQLITE_STATIC);
	sqlite3_bind_text(members, 5, member->identity, -1, SQLITE_STATIC);
	sqlite3_bind_int(members, 6, member->fit.matches);
	bind_known(members, 7, member->agreement_ns);
	bind_known(members, 8, member->agreement_bound_ns);
	rc = incise_schema_run(members);
	for (size_t i = 0; i < member->map.n && rc == SQLITE_OK; i++) {
		const struct incise_session_knot *knot = &member->map.knots[i];

		sqlite3_bind_int(maps, 1, at);
		sqlite3_bind_int64(maps, 2, (sqlite3_int64)i);
		sqlite3_bind_int64(maps, 3, knot->t_ns);
		sqlite3_bind_int64(maps, 4, knot->to_ns);
		sqlite3_bind_double(maps, 5, knot->bound_ns);
		rc = incise_schema_run(maps);
	}
	return rc;
}

#define TEXT_OF(x) TEXT_OF_(x)
#define TEXT_OF_(x) #x

/* Returns an SQLite code. */
static int write_tables(struct join *join, sqlite3 *db)
{
	sqlite3_stmt *members = NULL, *maps = NULL, *pairs = NULL;
	uint32_t crc;
	int rc = sqlite3_exec(
		db,
		"PRAGMA application_id=" TEXT_OF(INCISE_SCHEMA_JOINED) ";PRAGMA user_version=" TEXT_OF(
			INCISE_SESSION_VERSION) ";BEGIN",
		NULL, NULL, NULL);

	for (int i = 0; incise_session_tables[i] && rc == SQLITE_OK; i++)
		rc = sqlite3_exec(db, incise_session_tables[i], NULL, NULL, NULL);
	if (rc == SQLITE_OK)
		rc = sqlite3_prepare_v2(
			db, "INSERT INTO members VALUES(?, ?, ?, ?, ?, ?, ?, ?)", -1,
			&members, NULL);
	if (rc == SQLITE_OK)
		rc = sqlite3_prepare_v2(db, "INSERT INTO maps VALUES(?, ?, ?, ?, ?)", -1,
					&maps, NULL);
	if (rc == SQLITE_OK)
		rc = sqlite3_prepare_v2(db, "INSERT INTO session VALUES(?, ?)", -1,
					&pairs, NULL);
	for (int i = 0; i < join->n && rc == SQLITE_OK; i++)
		rc = put_member(&join->members[i], i, members, maps);
	if (rc == SQLITE_OK) {
		sqlite3_bind_text(pairs, 1, "incise", -1, SQLITE_STATIC);
		sqlite3_bind_text(pairs, 2, incise_version(), -1, SQLITE_STATIC);
		rc = incise_schema_run(pairs);
	}
	if (rc == SQLITE_OK)
		rc = incise_session_seal(db, &crc);
	if (rc == SQLITE_OK) {
		sqlite3_bind_text(pairs, 1, "seal", -1, SQLITE_STATIC);
		sqlite3_bind_int64(pairs, 2, crc);
		rc = incise_schema_run(pairs);
	}
	sqlite3_finalize(members);
	sqlite3_finalize(maps);
	sqlite3_finalize(pairs);
	return rc == SQLITE_OK ? sqlite3_exec(db, "COMMIT", NULL, NULL, NULL) : rc;
}

static int write_database(struct join *join, const char *folder)
{
	sqlite3 *db = NULL;
	char *path;
	int rc;

	if (asprintf(&path, "%s/%s", folder, INCISE_SCHEMA_DB) < 0)
		return incise_schema_no_memory(folder, join->err);
	rc = sqlite3_open_v2(
		path, &db,
		SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, NULL);
	if (rc == SQLITE_OK)
		rc = write_tables(join, db);
	if (rc != SQLITE_OK)
		rc = incise_error_set(join->err, incise_schema_errno(db),
				      "%s: cannot be written: %s", path,
				      db ? sqlite3_errmsg(db) : strerror(ENOMEM));
	sqlite3_close(db);
	free(path);
	return rc;
}

static int write_session(struct join *join, const char *output)
{
	char *part;
	bool made = false;
	int rc = 0;

	if (!access(output, F_OK))
		return incise_error_set(join->err, EEXIST,
					"%s: exists; give another name", output);
	if (asprintf(&part, "%s.part", output) < 0)
		return incise_schema_no_memory(output, join->err);
	if (mkdir(part, 0777))
		rc = incise_error_set(
			join->err, errno, "%s: cannot be made: %s; %s",
			errno == EEXIST ? part : output, strerror(errno),
			errno == EEXIST	  ? "a join was interrupted: remove it"
			: errno == ENOENT ? "make its folder, or give another name"
					  : "give another name");
	made = !rc;
	for (int i = 0; i < join->n && !rc; i++)
		rc = bring_member(join, &join->members[i], part);
	if (!rc)
		rc = write_database(join, part);
	if (!rc)
		rc = incise_recording_try(part, join->err);
	if (!rc && rename(part, output))
		rc = incise_error_set(join->err, errno, "%s: %s", output,
				      strerror(errno));
	if (rc && made)
		incise_database_remove(part);
	free(part);
	return rc;
}

int incise_session_join(const char *const *paths, int n,
			const struct incise_session_options *options, const char *output,
			struct incise_error *err)
{
	struct join join = {.options = options, .err = err};
	int rc = 0;

	if (n < 2 || n > INCISE_SESSION_MEMBERS_MAX)
		return incise_error_set(err, EINVAL,
					"%d recordings: 2 to %d can be joined", n,
					INCISE_SESSION_MEMBERS_MAX);
	join.members = calloc((size_t)n, sizeof(*join.members));
	if (!join.members)
		return incise_schema_no_memory(output, err);
	for (int i = 0; i < n && !rc; i++)
		rc = open_member(&join, paths[i]);
	for (int i = 0; i < n && !rc; i++)
		rc = map_clock(&join, i);
	if (!rc)
		rc = write_session(&join, output);
	for (int i = 0; i < join.n; i++) {
		struct member *member = &join.members[i];

		incise_recording_close(member->recording);
		incise_wall_free(member->wall);
		free(member->identity);
		free(member->map.knots);
	}
	free(join.members);
	return rc;
}
