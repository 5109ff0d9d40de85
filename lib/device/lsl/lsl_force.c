// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A force channel from a stream of the Lab Streaming Layer, "lsl:NAME:CHANNEL".
 *
 *   outlet ─▶ network ─▶ queue of liblsl (10 s) ─▶ thread, every 5 ms ─▶ feed
 *
 * The stream's description has the unit of each channel (XDF: channels/channel/label, unit).
 * Newtons become steps of 2^-17 N of a channel that measures newtons; volts become steps that
 * the calibration converts. Timestamps are the sender's, corrected to the clock here, which is
 * CLOCK_MONOTONIC, by liblsl's measurement of the offset.
 */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../rig/backends.h"
#include "../../rig/daq_feed.h"
#include "liblsl.h"

#define FIND_S 5.0
#define ANSWER_S 5.0
#define SCAN_S 1.0
#define QUEUE_S 10
#define PULL_MS 5
#define CORRECT_MS 1000 /* between two looks at the correction */
#define DEAD_MS 10000	/* of a stream that may come back */
#define CHANNELS_MAX 256
#define CHUNK 4096 /* values */
#define BITS 31
#define STREAMS_MAX 64
#define OLD_S (QUEUE_S + 5.0) /* in the queue here, and some in the sender's */
#define AHEAD_S 0.5	      /* a correction that is off by more is invalid */
#define BACK_NS 250e6	      /* no clock is set back by less */
#define STRAYS 8   /* samples in a row of another time, after which it is the right one */
#define DOUBTS 100 /* samples after which a sender is wrong, not one sample */

/* Units in which a force comes; the range is ± half of 2^BITS steps. */
static const struct unit {
	const char *names[6];
	double factor; /* to N or V */
	bool newtons;
} units[] = {
	{{"N", "n", "newton", "newtons", "Newton", "Newtons"}, 1, true},
	{{"mN", "millinewton", "millinewtons"}, 1e-3, true},
	{{"kN", "kilonewton", "kilonewtons"}, 1e3, true},
	{{"V", "volt", "volts", "Volts"}, 1, false},
	{{"mV", "millivolt", "millivolts", "Millivolts"}, 1e-3, false},
};
#define NEWTONS_SPAN 16384.0 /* ±8192 N by 7.6 µN: more than a single of 500 N resolves */
#define VOLTS_SPAN 64.0	     /* ±32 V by 30 nV */

struct lsl_force {
	struct daq_feed feed; /* first */
	struct liblsl lsl;
	lsl_inlet inlet;
	struct incise_clock *clock;
	struct incise_pace pace;
	int n_channels, channel;
	const struct unit *unit;
	double step;	 /* N or V per code */
	int64_t last_ns; /* of the last sample; 0: no sample */
	double last_value;
	int strays;
	/* Samples that were taken; of no time in the queue, and how far that was off; of an equal time. */
	uint64_t taken, timeless, equal, repeated;
	double off_s;
	double correction_s;
	double values[CHUNK], times[CHUNK];
};

/* --- thread --- */

static int32_t code_of(const struct lsl_force *f, double value)
{
	double top = ldexp(1, BITS) - 1;
	double code = round(value * f->unit->factor / f->step) + ldexp(1, BITS - 1);

	return (int32_t)fmax(0, fmin(code, top));
}

static void take_lsl_force(struct lsl_force *f, double value, double stamp_s,
			   int64_t now_ns)
{
	double t_s = stamp_s + f->correction_s, now_s = (double)now_ns * 1e-9;
	int64_t t_ns;

	/* No sample in the queue can have this time: it is lost, like a force that is no number. */
	if (!(t_s >= 0 && t_s > now_s - OLD_S && t_s < now_s + AHEAD_S)) {
		f->timeless++;
		f->off_s = t_s - now_s;
		incise_pace_skip(&f->pace, 1);
		daq_feed_lose(&f->feed, 1);
		return;
	}
	t_ns = (int64_t)(t_s * 1e9);
	/* A single time that runs back is wrong, and a regular stream has one to put in its place. */
	if (f->taken && (double)(f->last_ns - t_ns) > BACK_NS && f->strays++ < STRAYS)
		t_ns = f->last_ns + llround(f->pace.period_ns);
	else
		f->strays = 0;
	if (f->taken && t_ns == f->last_ns) {
		f->equal++;
		f->repeated += value == f->last_value;
	}
	f->taken++;
	f->last_ns = t_ns;
	f->last_value = value;
	daq_feed_pace(&f->feed, &f->pace, t_ns, now_ns);
	if (isfinite(value))
		daq_feed_put(&f->feed, t_ns, code_of(f, value));
	else
		daq_feed_lose(&f->feed, 1);
}

/* The fault of most samples, which a count of losses does not show; NULL: no fault. */
static const char *doubt(struct lsl_force *f, char text[200])
{
	if (f->timeless >= DOUBTS && !f->taken)
		snprintf(text, 200,
			 "its timestamps are %.9g s %s LSL's clock; let the sender stamp "
			 "samples by local_clock()",
			 fabs(f->off_s), f->off_s > 0 ? "ahead of" : "behind");
	else if (f->equal < DOUBTS || f->equal < f->taken / 3)
		return NULL;
	else if (f->repeated == f->equal)
		snprintf(text, 200,
			 "it sends each sample more than once; mend the sender");
	else
		snprintf(text, 200,
			 "many samples in a row have one timestamp; let the sender stamp "
			 "samples by local_clock()");
	return text;
}

/* Samples taken, or a negative error of liblsl. */
static int pull(struct lsl_force *f, int64_t now_ns)
{
	unsigned long most = CHUNK / (unsigned long)f->n_channels, got, n;
	int32_t error = 0;

	got = f->lsl.lsl_pull_chunk_d(f->inlet, f->values, f->times,
				      most * (unsigned long)f->n_channels, most, 0,
				      &error);
	n = got / (unsigned long)f->n_channels;
	for (unsigned long i = 0; i < n && i < most; i++)
		take_lsl_force(f,
			       f->values[i * (unsigned long)f->n_channels +
					 (unsigned long)f->channel],
			       f->times[i], now_ns);
	return error < 0 && !n ? error : (int)n;
}

/* Each estimate is the best of a few round trips, made in the background. */
static int correct(struct lsl_force *f, double timeout_s, double *uncertainty_s)
{
	double remote_s, correction_s;
	int32_t error = 0;

	correction_s = f->lsl.lsl_time_correction_ex(f->inlet, &remote_s, uncertainty_s,
						     timeout_s, &error);
	if (error || !isfinite(correction_s))
		return -ETIME;
	f->correction_s = correction_s;
	return 0;
}

static void *run_lsl_force(void *argument)
{
	struct lsl_force *f = argument;
	int64_t last_ns = incise_clock_now(f->clock), corrected_ns = last_ns;
	const char *wrong = NULL;
	double uncertainty_s;
	char text[200];
	int error = 0; /* of liblsl, or LSL_TIMEOUT: nothing comes */

	while (!error && !wrong && daq_feed_wait(&f->feed, -1, PULL_MS) != DAQ_STOP) {
		int64_t now_ns = incise_clock_now(f->clock);
		int got;

		if (now_ns - corrected_ns > CORRECT_MS * INT64_C(1000000)) {
			correct(f, 0, &uncertainty_s);
			corrected_ns = now_ns;
		}
		got = pull(f, now_ns);
		wrong = doubt(f, text);
		if (got > 0)
			last_ns = now_ns;
		else if (got < 0)
			error = got;
		else if (now_ns - last_ns > DEAD_MS * INT64_C(1000000))
			error = LSL_TIMEOUT;
	}
	daq_feed_end(
		&f->feed, error || wrong ? -EIO : 0,
		wrong ? wrong
		: error == LSL_TIMEOUT
			? "no more samples arrived; see the program that sends them, "
			  "and start again"
			: "the stream ended; start its program, and start again");
	return NULL;
}

/* --- opening --- */

static void force_close(struct incise_force *force)
{
	struct lsl_force *f = (struct lsl_force *)force;

	daq_feed_stop(&f->feed);
	if (f->inlet)
		f->lsl.lsl_destroy_inlet(f->inlet);
	daq_feed_free(&f->feed);
	free(f);
}

static const struct incise_force_ops force_ops = {
	.read = daq_feed_read,
	.info = daq_feed_info,
	.lost = daq_feed_lost,
	.close = force_close,
	.cause = daq_feed_cause,
};

/* Text of other machines in a message. */
static const char *make_plain_lsl(char *to, size_t size, const char *text)
{
	size_t n = 0;

	for (; text && text[n] && n + 1 < size; n++)
		to[n] = (unsigned char)text[n] < ' ' || text[n] == 0x7f ? '?' : text[n];
	to[n] = '\0';
	return to;
}

static const struct unit *unit_of_lsl_force(const char *name)
{
	for (size_t i = 0; i < sizeof(units) / sizeof(*units); i++)
		for (size_t k = 0; k < sizeof(units->names) / sizeof(*units->names); k++)
			if (units[i].names[k] && !strcmp(units[i].names[k], name))
				return &units[i];
	return NULL;
}

/* Split "NAME:CHANNEL"; *channel is NULL without one. */
static int split(const char *arguments, char *name, size_t size, const char **channel,
		 const char *where, struct incise_error *err)
{
	const char *colon = strrchr(arguments, ':');
	size_t length = colon ? (size_t)(colon - arguments) : strlen(arguments);

	*channel = colon ? colon + 1 : NULL;
	if (length && length < size && (!colon || colon[1])) {
		snprintf(name, size, "%.*s", (int)length, arguments);
		return 0;
	}
	return incise_error_set(
		err, EINVAL,
		"%s: \"%.60s\": expected lsl:NAME or lsl:NAME:CHANNEL, for "
		"example lsl:Plate:Fz; see `incise info devices`",
		where, arguments);
}

static int find_lsl_force(struct lsl_force *f, const char *name, const char *where,
			  struct incise_error *err)
{
	lsl_streaminfo found[2] = {0};
	int n = f->lsl.lsl_resolve_byprop(found, 2, "name", name, 1, FIND_S), rc = 0;

	if (n < 1)
		rc = incise_error_set(
			err, ENODEV,
			"%s: no LSL stream \"%.60s\" found within %g s; start "
			"the program that sends it, and see `incise info devices`",
			where, name, FIND_S);
	else if (n > 1)
		rc = incise_error_set(
			err, EINVAL,
			"%s: more than one LSL stream is called \"%.60s\"; give "
			"each its own name",
			where, name);
	else
		f->inlet = f->lsl.lsl_create_inlet(found[0], QUEUE_S, 0, 1);
	for (int i = 0; i < n && i < 2; i++)
		f->lsl.lsl_destroy_streaminfo(found[i]);
	if (!rc && !f->inlet)
		rc = incise_error_set(err, EIO,
				      "%s: the LSL stream \"%.60s\" cannot be received; "
				      "restart the program that sends it",
				      where, name);
	return rc;
}

/* "Fz (N), Mx (Nm)", for a message. */
static void append_channel(char *list, size_t size, const char *label, const char *unit)
{
	size_t used = strlen(list);
	char a[40], b[20];

	snprintf(list + used, size - used, "%s%s (%s)", used ? ", " : "",
		 make_plain_lsl(a, sizeof(a), label),
		 *unit ? make_plain_lsl(b, sizeof(b), unit) : "no unit");
}

/* By label, else by number from 0; without @asked the only one with a unit of a force. */
static int choose_channel(struct lsl_force *f, lsl_streaminfo info, const char *asked,
			  const char *where, struct incise_error *err)
{
	const struct liblsl *lsl = &f->lsl;
	lsl_xml one = lsl->lsl_child(lsl->lsl_child(lsl->lsl_get_desc(info), "channels"),
				     "channel");
	char list[200] = "", wrong[20] = "", *end = NULL;
	long number = asked ? strtol(asked, &end, 10) : -1;
	int fits = 0;

	if (!asked || end == asked || *end || number >= f->n_channels)
		number = -1;
	f->channel = -1;
	for (int i = 0; i < f->n_channels; i++) {
		bool described = one && !lsl->lsl_empty(one);
		const char *label = described ? lsl->lsl_child_value_n(one, "label") : "";
		const char *unit = described ? lsl->lsl_child_value_n(one, "unit") : "";
		const struct unit *known = unit_of_lsl_force(unit);

		if (asked ? !strcmp(label, asked) || (f->channel < 0 && number == i)
			  : !!known) {
			fits += f->channel != i;
			f->channel = i;
			f->unit = known;
			make_plain_lsl(wrong, sizeof(wrong), unit);
		}
		append_channel(list, sizeof(list), *label ? label : "no label", unit);
		one = described ? lsl->lsl_next_sibling_n(one, "channel") : NULL;
	}
	if (f->channel < 0 && asked)
		return incise_error_set(err, EINVAL,
					"%s: the stream has no channel \"%.40s\"; it has "
					"%.200s; name one of these",
					where, asked, list);
	if (f->channel < 0 || fits > 1)
		return incise_error_set(
			err, EINVAL,
			"%s: name its channel, as in lsl:NAME:CHANNEL; the "
			"stream has %.200s",
			where, list);
	if (f->unit)
		return 0;
	return incise_error_set(
		err, EINVAL,
		"%s: channel %d of the stream has %s%s%s; expected N, mN, kN, "
		"V or mV in its description (channels/channel/unit)",
		where, f->channel, *wrong ? "the unit \"" : "no unit", wrong,
		*wrong ? "\"" : "");
}

static int describe_lsl_force(struct lsl_force *f, const char *name, const char *asked,
			      const char *where, struct incise_error *err)
{
	struct incise_force_info *out = &f->feed.info;
	int32_t error = 0;
	lsl_streaminfo info = f->lsl.lsl_get_fullinfo(f->inlet, ANSWER_S, &error);
	char shown[40];
	int rc = 0;

	if (!info || error)
		return incise_error_set(
			err, EIO,
			"%s: the LSL stream \"%.60s\" sends no description "
			"within %g s; restart the program that sends it",
			where, name, ANSWER_S);
	out->rate_hz = f->lsl.lsl_get_nominal_srate(info);
	f->n_channels = f->lsl.lsl_get_channel_count(info);
	if (f->lsl.lsl_get_channel_format(info) == LSL_STRING || f->n_channels < 1 ||
	    f->n_channels > CHANNELS_MAX)
		rc = incise_error_set(
			err, EINVAL,
			"%s: the LSL stream \"%.60s\" has no numbers, or more "
			"than %d channels; name another",
			where, name, CHANNELS_MAX);
	else if (!(out->rate_hz >= 1 && out->rate_hz <= 100000))
		rc = incise_error_set(
			err, EINVAL,
			"%s: the LSL stream \"%.60s\" has a nominal rate of "
			"%.9g Hz; expected 1 to 100000 Hz (a regular stream)",
			where, name, out->rate_hz);
	else
		rc = choose_channel(f, info, asked, where, err);
	f->lsl.lsl_destroy_streaminfo(info);
	if (rc)
		return rc;
	out->bits = BITS;
	out->newtons = f->unit->newtons;
	out->full_scale_V = out->newtons ? NEWTONS_SPAN : VOLTS_SPAN;
	out->offset_V = -out->full_scale_V / 2;
	f->step = ldexp(out->full_scale_V, -BITS);
	snprintf(out->name, sizeof(out->name), "LSL %s, channel %d",
		 make_plain_lsl(shown, sizeof(shown), name), f->channel);
	return 0;
}

static int connect_stream(struct lsl_force *f, const char *name, const char *where,
			  struct incise_error *err)
{
	double uncertainty_s = 0;
	int32_t error = 0;

	if (correct(f, ANSWER_S, &uncertainty_s))
		return incise_error_set(
			err, EIO,
			"%s: the clock of the LSL stream \"%.60s\" does not "
			"answer within %g s; let UDP ports 16572 to 16604 pass",
			where, name, ANSWER_S);
	/* A bound of the offset, half the round trip to either side, as a uniform one. */
	if (uncertainty_s > 0 && uncertainty_s < 1)
		f->feed.info.t_sd_ns = llround(uncertainty_s / sqrt(3) * 1e9);
	f->lsl.lsl_open_stream(f->inlet, ANSWER_S, &error);
	return error ? incise_error_set(
			       err, EIO,
			       "%s: the LSL stream \"%.60s\" does not open within %g s; "
			       "restart the program that sends it",
			       where, name, ANSWER_S)
		     : 0;
}

static int start_lsl_force(struct lsl_force *f, const char *where,
			   struct incise_error *err)
{
	int rc = daq_feed_init(&f->feed);

	incise_pace_init(&f->pace, f->feed.info.rate_hz, INCISE_PACE_OFF, 1);
	if (!rc)
		rc = daq_feed_start(&f->feed, run_lsl_force, f);
	return rc ? incise_error_set(err, -rc,
				     "%s: no thread or memory to receive it: %s; "
				     "end other programs",
				     where, strerror(-rc))
		  : 0;
}

static int open_stream(struct lsl_force *f, const struct incise_backend_request *request,
		       struct incise_error *err)
{
	const char *asked, *where = request->where;
	char name[100];
	int rc = split(request->arguments, name, sizeof(name), &asked, where, err);

	rc = rc ? rc : liblsl_open(&f->lsl, where, err);
	rc = rc ? rc : find_lsl_force(f, name, where, err);
	rc = rc ? rc : describe_lsl_force(f, name, asked, where, err);
	rc = rc ? rc : connect_stream(f, name, where, err);
	return rc ? rc : start_lsl_force(f, where, err);
}

static void *force_open(const struct incise_backend_request *request,
			struct incise_error *err)
{
	struct lsl_force *f = incise_backend_alloc(sizeof(*f), request->where, err);
	sigset_t all, before;
	int rc;

	if (!f)
		return NULL;
	f->feed.force.ops = &force_ops;
	f->feed.stop = -1;
	f->clock = request->clock;
	/* The threads of liblsl are not to take this program's signals. */
	sigfillset(&all);
	pthread_sigmask(SIG_SETMASK, &all, &before);
	rc = open_stream(f, request, err);
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	if (!rc)
		return &f->feed.force;
	force_close(&f->feed.force);
	errno = -rc;
	return NULL;
}

/* --- search --- */

/*
 * The channels of a stream, which are in its full description alone, and the first channel with a
 * unit of a force. Returns how many have one.
 */
static int list_channels(const struct liblsl *lsl, lsl_streaminfo found, char *list,
			 size_t size, char *first, size_t first_size)
{
	lsl_inlet inlet = lsl->lsl_create_inlet(found, 1, 0, 0);
	int32_t error = 0;
	lsl_streaminfo info = inlet ? lsl->lsl_get_fullinfo(inlet, SCAN_S, &error) : NULL;
	int fits = 0, n = info ? lsl->lsl_get_channel_count(info) : 0;
	lsl_xml one =
		info ? lsl->lsl_child(lsl->lsl_child(lsl->lsl_get_desc(info), "channels"),
				      "channel")
		     : NULL;

	for (int i = 0; i < n && i < CHANNELS_MAX && one && !lsl->lsl_empty(one); i++) {
		const char *label = lsl->lsl_child_value_n(one, "label");
		const char *unit = lsl->lsl_child_value_n(one, "unit");
		char shown[40];

		if (unit_of_lsl_force(unit) && !fits++)
			*label ? snprintf(first, first_size, "%s",
					  make_plain_lsl(shown, sizeof(shown), label))
			       : snprintf(first, first_size, "%d", i);
		append_channel(list, size, *label ? label : "no label", unit);
		one = lsl->lsl_next_sibling_n(one, "channel");
	}
	if (info)
		lsl->lsl_destroy_streaminfo(info);
	if (inlet)
		lsl->lsl_destroy_inlet(inlet);
	return fits;
}

/* If there are several channels of forces, the first is named, as an example that can be opened. */
static void show_lsl_force(const struct liblsl *lsl, lsl_streaminfo info,
			   struct incise_scan_device *device)
{
	char list[200] = "", first[48] = "";
	bool numbers = lsl->lsl_get_channel_format(info) != LSL_STRING;
	int fits = numbers ? list_channels(lsl, info, list, sizeof(list), first,
					   sizeof(first))
			   : 0;
	double rate_hz = lsl->lsl_get_nominal_srate(info);
	char text[100];

	*device = (struct incise_scan_device){0};
	snprintf(device->device, sizeof(device->device), "lsl:%.60s%s%s",
		 make_plain_lsl(text, sizeof(text), lsl->lsl_get_name(info)),
		 fits > 1 ? ":" : "", fits > 1 ? first : "");
	snprintf(device->what, sizeof(device->what),
		 "LSL stream of type %.40s, %d channel%s",
		 make_plain_lsl(text, sizeof(text), lsl->lsl_get_type(info)),
		 lsl->lsl_get_channel_count(info),
		 lsl->lsl_get_channel_count(info) == 1 ? "" : "s");
	incise_scan_tell(device, "host", "%.90s",
			 make_plain_lsl(text, sizeof(text), lsl->lsl_get_hostname(info)));
	incise_scan_tell(device, "channels", "%d", lsl->lsl_get_channel_count(info));
	if (*list)
		incise_scan_tell(device, "channel_list", "%s", list);
	incise_scan_tell(device, "rate_hz", "%.9g", rate_hz);
	incise_scan_tell(device, "time_stamps", "sender, corrected by LSL");
	device->usable = rate_hz >= 1 && rate_hz <= 100000 && fits > 0;
}

/* Without liblsl there are no streams to be found. */
static int force_scan(const char *arguments, incise_scan_found *found, void *context,
		      struct incise_error *err)
{
	struct incise_scan_device device;
	lsl_streaminfo all[STREAMS_MAX];
	struct liblsl lsl;
	int n, rc = *arguments ? liblsl_open(&lsl, "lsl", err)
			       : liblsl_open(&lsl, "lsl", NULL);

	if (rc)
		return *arguments ? rc : 0;
	n = *arguments ? lsl.lsl_resolve_byprop(all, STREAMS_MAX, "name", arguments, 1,
						SCAN_S)
		       : lsl.lsl_resolve_all(all, STREAMS_MAX, SCAN_S);
	for (int i = 0; i < n && i < STREAMS_MAX; i++) {
		if (!rc) {
			show_lsl_force(&lsl, all[i], &device);
			/* Poses and markers are no force channels, but a named stream is shown. */
			if (device.usable || *arguments)
				rc = found(context, &device);
		}
		lsl.lsl_destroy_streaminfo(all[i]);
	}
	return rc;
}

INCISE_BACKEND(incise_force_lsl, "force", "lsl", .open = force_open, .scan = force_scan);
