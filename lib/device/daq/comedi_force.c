// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A force channel on a DAQ card under comedi, "comedi:/dev/comedi0:0": a command streams
 * into the kernel's buffer until that overflows, and is then restarted.
 *
 *   card ─▶ its FIFO ─▶ kernel's buffer (up to 2 s) ─▶ thread, by blocks ─▶ feed
 *
 * There are no timestamps: t_ns is computed from the arrival of blocks. Only that time
 * gives the number of samples that an overflow lost, to a few samples; the overflow
 * itself is certain.
 */
#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <comedilib.h>
#include "../../base/monotonic.h"
#include "../../rig/backends.h"
#include "../../rig/daq_feed.h"
#include "../../rig/stable_path.h"

/* --- card: subdevice, channel, range, and the command that samples them --- */

#define TOLERANCE 0.01 /* of the rate */
#define WIDE 1.001     /* a range of 4.995 V is accepted for 5 V */
#define RANGES_MAX 32
#define BUFFER_S 2
#define TESTS 5 /* each corrects one stage of the command */

struct card {
	const char *where; /* starts each message; only during the set-up */
	struct incise_force_setup setup;
	char path[80];
	comedi_t *device;
	unsigned int subdevice, range, reference;
	unsigned int chanlist[1];
	comedi_cmd command;
	bool wide; /* samples of 4 bytes, else 2 */
	int bits;
	double full_scale_V, offset_V;
	double period_ns; /* accepted by the card */
	char note[300];	  /* see struct incise_force_info */
};

/* Bits of codes 0 … @maxdata; 0: no converter has these. */
static int bits_of(lsampl_t maxdata)
{
	int bits = 0;

	if (maxdata & (maxdata + 1) || maxdata > INT32_MAX)
		return 0;
	for (; maxdata; maxdata >>= 1)
		bits++;
	return bits;
}

/*
 * The narrowest range that is as wide as @full_scale_V; if two are, the range that starts
 * higher (0 … 5 V before ±2.5 V). Its number, or -1. For 0 V the first.
 */
static int choose_range(const comedi_range *ranges, int n, double full_scale_V)
{
	int best = full_scale_V > 0 ? -1 : 0;

	for (int i = 0; i < n && full_scale_V > 0; i++) {
		double wide = ranges[i].max - ranges[i].min;

		if (ranges[i].unit != UNIT_volt || !(wide * WIDE >= full_scale_V))
			continue;
		if (best < 0 || wide < ranges[best].max - ranges[best].min ||
		    (wide == ranges[best].max - ranges[best].min &&
		     ranges[i].min > ranges[best].min))
			best = i;
	}
	return n > 0 ? best : -1;
}

/* Whether a subdevice is an analog input that streams. */
static bool can_stream(comedi_t *device, unsigned int subdevice)
{
	int flags = comedi_get_subdevice_flags(device, subdevice);

	return comedi_get_subdevice_type(device, subdevice) == COMEDI_SUBD_AI &&
	       flags >= 0 && flags & SDF_CMD_READ;
}

/*
 * The period that the card accepts for @ns, of one channel; 0: it has no timer. Fills in
 * @command for @chanlist.
 */
static double command_period(comedi_t *device, unsigned int subdevice,
			     unsigned int *chanlist, unsigned int ns, comedi_cmd *command)
{
	int rc = 1;

	*command = (comedi_cmd){0};
	if (comedi_get_cmd_generic_timed(device, subdevice, command, 1, ns) < 0)
		return 0;
	command->chanlist = chanlist;
	command->chanlist_len = command->scan_end_arg = 1;
	command->stop_src = TRIG_NONE;
	command->stop_arg = 0;
	for (int i = 0; i < TESTS && rc; i++)
		rc = comedi_command_test(device, command);
	if (rc)
		return 0;
	if (command->scan_begin_src == TRIG_TIMER)
		return command->scan_begin_arg;
	/* With one channel, scans follow each other as conversions do. */
	return command->convert_src == TRIG_TIMER ? command->convert_arg : 0;
}

static int card_error(const struct card *card, int code, const char *what,
		      struct incise_error *err)
{
	return incise_error_set(err, code, "%s: %s: %s: %s; see `comedi_board_info %s`",
				card->where, card->path, what, strerror(code),
				card->path);
}

/* "/dev/comedi0:1"; -1 in @subdevice without a number. */
static int parse_comedi_force(struct card *card, const char *arguments, int *subdevice,
			      struct incise_error *err)
{
	const char *colon = strrchr(arguments, ':');
	size_t length = colon ? (size_t)(colon - arguments) : strlen(arguments);
	char *end = NULL;
	long number = -1;

	if (colon)
		number = strtol(colon + 1, &end, 10);
	*subdevice = number > INT_MAX ? -1 : (int)number;
	if (*arguments == '/' && length < sizeof(card->path) &&
	    (!colon || (end != colon + 1 && !*end && *subdevice >= 0))) {
		snprintf(card->path, sizeof(card->path), "%.*s", (int)length, arguments);
		return 0;
	}
	return incise_error_set(err, EINVAL,
				"%s: %.60s: expected comedi:DEVICE:SUBDEVICE such as "
				"comedi:/dev/comedi0:0; see `incise info devices`",
				card->where, arguments);
}

static int open_device(struct card *card, struct incise_error *err)
{
	int code;

	errno = 0;
	card->device = comedi_open(card->path);
	if (card->device)
		return 0;
	code = errno ? errno : ENODEV;
	if (code == EACCES || code == EPERM)
		return incise_error_set(err, EACCES,
					"%s: no permission to open %s; join its group "
					"(udev/ has the rules), or be root",
					card->where, card->path);
	return incise_error_set(err, code,
				"%s: %s: %s; load the driver of your card, and run "
				"comedi_config if it needs that",
				card->where, card->path, strerror(code));
}

static const struct {
	int flag, reference;
	const char *name;
} references[] = {
	[INCISE_FORCE_GROUND] = {SDF_GROUND, AREF_GROUND, "ground"},
	[INCISE_FORCE_COMMON] = {SDF_COMMON, AREF_COMMON, "common"},
	[INCISE_FORCE_DIFFERENTIAL] = {SDF_DIFF, AREF_DIFF, "differential"},
};

/* "ground, differential": references of a subdevice; their number. */
static int list_references(int flags, char *text, size_t size)
{
	int n = 0;

	snprintf(text, size, "none");
	for (int i = INCISE_FORCE_GROUND; i <= INCISE_FORCE_DIFFERENTIAL; i++)
		if (flags & references[i].flag) {
			size_t used = n ? strlen(text) : 0;

			snprintf(text + used, size - used, "%s%s", n++ ? ", " : "",
				 references[i].name);
		}
	return n;
}

/* The one of rig.conf, or the first that the subdevice has. */
static int take_reference(struct card *card, int flags, struct incise_error *err)
{
	enum incise_force_reference asked = card->setup.reference, i = asked;
	char known[40];
	int n = list_references(flags, known, sizeof(known));

	if (!asked)
		for (i = INCISE_FORCE_GROUND; n && !(flags & references[i].flag);)
			i++;
	if (asked && !(flags & references[asked].flag))
		return incise_error_set(err, EINVAL,
					"%s: %s has no reference \"%s\"; correct "
					"force_setup.reference (available: %s)",
					card->where, card->path, references[asked].name,
					known);
	card->reference = n ? (unsigned int)references[i].reference : AREF_OTHER;
	if (!asked && n > 1)
		snprintf(card->note, sizeof(card->note),
			 "compared with %s, but the card has %s; set "
			 "force_setup.reference as the sensor is wired",
			 references[i].name, known);
	return 0;
}

static int take_subdevice(struct card *card, int asked, struct incise_error *err)
{
	int n = comedi_get_n_subdevices(card->device), flags, rc;

	for (int i = 0; i < n && asked < 0; i++)
		if (can_stream(card->device, (unsigned int)i))
			asked = i;
	if (asked < 0 || asked >= n || !can_stream(card->device, (unsigned int)asked))
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: %s: subdevice %d is not an analogue input with timed "
			"sampling; see `comedi_board_info -v %s`",
			card->where, card->path, asked, card->path);
	card->subdevice = (unsigned int)asked;
	flags = comedi_get_subdevice_flags(card->device, card->subdevice);
	if (flags & SDF_BUSY)
		return incise_error_set(err, EBUSY,
					"%s: %s is in use by another program; end it",
					card->where, card->path);
	card->wide = flags & SDF_LSAMPL;
	rc = take_reference(card, flags, err);
	if (rc)
		return rc;
	/* A file reads one subdevice; any but the first must be chosen. */
	if (comedi_get_read_subdevice(card->device) != asked &&
	    comedi_set_read_subdevice(card->device, card->subdevice) < 0)
		return card_error(card, EOPNOTSUPP, "this subdevice cannot be read", err);
	return 0;
}

/* "-5 to 5, 0 to 5": ranges in V of a channel. */
static void list_ranges(comedi_t *device, unsigned int subdevice, unsigned int channel,
			char *text, size_t size)
{
	int n = comedi_get_n_ranges(device, subdevice, channel);
	size_t used = 0;

	*text = '\0';
	for (int i = 0; i < n && used < size; i++) {
		const comedi_range *range =
			comedi_get_range(device, subdevice, channel, (unsigned int)i);

		if (range && range->unit == UNIT_volt)
			used += (size_t)snprintf(text + used, size - used,
						 "%s%.6g to %.6g", used ? ", " : "",
						 range->min, range->max);
	}
}

static int no_range(const struct card *card, struct incise_error *err)
{
	char known[200];

	list_ranges(card->device, card->subdevice, (unsigned int)card->setup.channel,
		    known, sizeof(known));
	return incise_error_set(err, ERANGE,
				"%s: %s has no range of %.6g V; set "
				"force_setup.full_scale_V (ranges in V: %s)",
				card->where, card->path, card->setup.full_scale_V,
				*known ? known : "none");
}

static int take_channel(struct card *card, struct incise_error *err)
{
	unsigned int channel = (unsigned int)card->setup.channel;
	int n = comedi_get_n_channels(card->device, card->subdevice), range;
	comedi_range ranges[RANGES_MAX] = {0};
	lsampl_t maxdata;

	if (card->setup.channel < 0 || card->setup.channel >= n ||
	    *card->setup.channel_name)
		return incise_error_set(err, EINVAL,
					"%s: %s has channels 0 to %d; correct "
					"force_setup.channel",
					card->where, card->path, n - 1);
	maxdata = comedi_get_maxdata(card->device, card->subdevice, channel);
	card->bits = bits_of(maxdata);
	if (!card->bits)
		return incise_error_set(err, EOPNOTSUPP,
					"%s: %s: codes up to %u are not those of a "
					"converter of 1 to 31 bits; use another card",
					card->where, card->path, maxdata);
	n = comedi_get_n_ranges(card->device, card->subdevice, channel);
	n = n < RANGES_MAX ? n : RANGES_MAX;
	for (int i = 0; i < n; i++) {
		comedi_range *one = comedi_get_range(card->device, card->subdevice,
						     channel, (unsigned int)i);

		ranges[i] = one ? *one : (comedi_range){.unit = UNIT_none};
	}
	range = choose_range(ranges, n, card->setup.full_scale_V);
	if (range < 0 || ranges[range].unit != UNIT_volt ||
	    !(ranges[range].max > ranges[range].min))
		return no_range(card, err);
	card->range = (unsigned int)range;
	/* Its highest code is the top of the range; a full scale is one code more. */
	card->full_scale_V =
		(ranges[range].max - ranges[range].min) / maxdata * ((double)maxdata + 1);
	card->offset_V = ranges[range].min;
	card->chanlist[0] = CR_PACK(channel, card->range, card->reference);
	return 0;
}

static int take_rate(struct card *card, struct incise_error *err)
{
	double asked_ns = 1e9 / card->setup.rate_hz;
	int want;

	card->period_ns = command_period(card->device, card->subdevice, card->chanlist,
					 (unsigned int)lround(asked_ns), &card->command);
	if (card->period_ns <= 0)
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: %s does not support timed sampling; use another card",
			card->where, card->path);
	if (fabs(card->period_ns - asked_ns) > asked_ns * TOLERANCE)
		return incise_error_set(
			err, EINVAL,
			"%s: %s does not support %.9g Hz, the nearest is %.9g Hz; set "
			"force_setup.rate_hz",
			card->where, card->path, card->setup.rate_hz,
			1e9 / card->period_ns);
	/* The driver refuses a larger buffer than the maximum. */
	want = (int)(card->setup.rate_hz * BUFFER_S) * (card->wide ? 4 : 2);
	if (comedi_get_buffer_size(card->device, card->subdevice) < want) {
		int most = comedi_get_max_buffer_size(card->device, card->subdevice);

		comedi_set_buffer_size(card->device, card->subdevice,
				       (unsigned int)(want < most ? want : most));
	}
	return 0;
}

static int card_open(struct card *card, const char *arguments, struct incise_error *err)
{
	int subdevice, rc = parse_comedi_force(card, arguments, &subdevice, err);

	rc = rc ? rc : open_device(card, err);
	rc = rc ? rc : take_subdevice(card, subdevice, err);
	rc = rc ? rc : take_channel(card, err);
	return rc ? rc : take_rate(card, err);
}

static int card_start(struct card *card)
{
	comedi_cmd command = card->command;

	errno = 0;
	if (comedi_command(card->device, &command) >= 0)
		return 0;
	return errno ? -errno : -EIO;
}

static void card_close(struct card *card)
{
	if (!card->device)
		return;
	comedi_cancel(card->device, card->subdevice);
	comedi_close(card->device);
	card->device = NULL;
}

/*
 * --- times ---
 *
 * The time of each sample of a card without timestamps, from the arrival of blocks and
 * the number of samples in them.
 *
 *   start T  2T  3T  4T  5T               sample n is taken at start + (n + 1) T
 *     |---|---|---|---|---|···            blocks arrive late by their time in the card:
 *                   ▲         ▲           the least delay within a second is taken for
 *                block 1   block 2        constant, and its drift moves start
 *
 * A reader that was delayed finds many blocks waiting, which is no drift: only blocks
 * that empty the kernel's buffer count, at least eight of them; and no clock is off by
 * 1000 ppm.
 *
 * The error is the card's least delay, which is unknown here: milliseconds with a card
 * that transfers its FIFO when it is half full. No time is later than the arrival, and
 * each is later than the one before.
 */

#define WINDOW_NS 1000000000LL
#define WINDOW_BLOCKS 8
#define DRIFT_MAX 1e-3

struct times {
	double period_ns;
	int64_t start_ns, last_ns;
	double shift_ns; /* drift of the card's clock since start_ns */
	uint64_t n;	 /* samples since start_ns */
	int64_t window_ns;
	int blocks;		   /* of this window that emptied the kernel's buffer */
	double least_ns, usual_ns; /* delay: of this window, of the first one */
	bool has_usual;
};

/* @period_ns > 0 */
static void times_init(struct times *s, double period_ns)
{
	*s = (struct times){.period_ns = period_ns, .last_ns = -1};
}

/* A command was started at @t_ns. */
static void times_start(struct times *s, int64_t t_ns)
{
	s->start_ns = s->window_ns = t_ns;
	s->shift_ns = 0;
	s->n = 0;
	s->least_ns = INFINITY;
	s->has_usual = false;
	s->blocks = 0;
}

static double since_start(const struct times *s, uint64_t n)
{
	return s->shift_ns + s->period_ns * (double)n;
}

/* A block of @n samples arrived at @t_ns; @last: it emptied the buffer. */
static void times_block(struct times *s, int64_t t_ns, uint64_t n, bool last)
{
	double delay = (double)(t_ns - s->start_ns) - since_start(s, s->n + n);

	/* A sample is not taken after its arrival. */
	if (delay < 0) {
		s->shift_ns += delay;
		s->usual_ns -= fmin(s->usual_ns, -delay);
		s->least_ns += -delay;
		delay = 0;
	}
	if (!last)
		return;
	s->least_ns = fmin(s->least_ns, delay);
	if (++s->blocks < WINDOW_BLOCKS || t_ns - s->window_ns < WINDOW_NS)
		return;
	if (s->has_usual) {
		double most = DRIFT_MAX * (double)(t_ns - s->window_ns);

		s->shift_ns += fmin(fmax(s->least_ns - s->usual_ns, -most), most);
	} else {
		s->usual_ns = s->least_ns;
	}
	s->has_usual = true;
	s->window_ns = t_ns;
	s->least_ns = INFINITY;
	s->blocks = 0;
}

/* The time of the next sample of the block. */
static int64_t times_next(struct times *s)
{
	int64_t t_ns = s->start_ns + (int64_t)since_start(s, ++s->n);

	if (t_ns <= s->last_ns)
		t_ns = s->last_ns + 1;
	return s->last_ns = t_ns;
}

/* --- channel --- */

#define QUIET_MS 20 /* between two polls of a card whose FIFO fills slowly */
#define DEAD_NS 3e9 /* without a sample, and ten periods */
#define PERIODS_DEAD 10
#define RESTARTS 5 /* in a row without a sample */
#define BLOCK_BYTES 8192

struct comedi_force {
	struct daq_feed feed; /* first */
	struct card card;
	struct times times;
	/* The thread's. */
	int64_t received_ns; /* time of the last sample, or start of the command */
	bool gap;	     /* no sample since the command was restarted */
	int restarts;
	unsigned int rest; /* bytes of an incomplete sample */
	_Alignas(8) unsigned char block[BLOCK_BYTES];
};

/* Count the samples missing while no command ran; an overflow lost at least one. */
static void count_gap(struct comedi_force *f, int64_t last_ns, int64_t t_ns)
{
	double steps = round((double)(t_ns - last_ns) / f->card.period_ns);

	if (last_ns >= 0)
		daq_feed_lose(&f->feed, steps >= 2 ? (uint64_t)steps - 1 : 1);
	f->gap = false;
}

/* @last: the block emptied the buffer. */
static void pass_on(struct comedi_force *f, size_t bytes, bool last)
{
	size_t size = f->card.wide ? sizeof(lsampl_t) : sizeof(sampl_t);
	size_t n = bytes / size;

	times_block(&f->times, f->received_ns, n, last);
	for (size_t i = 0; i < n; i++) {
		int64_t last_ns = f->times.last_ns;
		int64_t t_ns = times_next(&f->times);
		lsampl_t wide = 0;
		sampl_t narrow = 0;

		if (f->card.wide)
			memcpy(&wide, f->block + i * sizeof(wide), sizeof(wide));
		else
			memcpy(&narrow, f->block + i * sizeof(narrow), sizeof(narrow));
		if (f->gap)
			count_gap(f, last_ns, t_ns);
		/* Bits above the converter's do not belong to the sample. */
		daq_feed_put(&f->feed, t_ns,
			     (int32_t)((wide | narrow) &
				       ((UINT32_C(1) << f->card.bits) - 1)));
	}
	f->rest = (unsigned int)(bytes - n * size);
	memmove(f->block, f->block + n * size, f->rest);
}

/* 0 or -errno. */
static int restart(struct comedi_force *f)
{
	if (++f->restarts > RESTARTS)
		return -EIO;
	comedi_cancel(f->card.device, f->card.subdevice);
	f->rest = 0;
	f->gap = true;
	f->received_ns = incise_monotonic_ns();
	times_start(&f->times, f->received_ns);
	return card_start(&f->card);
}

/* Handle the result of a read. 0, or -errno where it ends the stream. */
static int handle_read(struct comedi_force *f, ssize_t got)
{
	double dead_ns = DEAD_NS + PERIODS_DEAD * f->card.period_ns;

	if (got > 0) {
		f->received_ns = incise_monotonic_ns();
		f->restarts = 0;
		pass_on(f, f->rest + (size_t)got, f->rest + (size_t)got < BLOCK_BYTES);
		return 0;
	}
	/* The command has ended: the buffer was full, or by itself. */
	if (got == 0 || got == -EPIPE)
		return restart(f);
	if (got == -EINTR)
		return 0;
	if (got != -EAGAIN)
		return got == -ENODEV || got == -ENXIO ? -ENODEV : -EIO;
	/* A card that waits for its FIFO to fill can be asked for its samples. */
	comedi_poll(f->card.device, f->card.subdevice);
	return (double)(incise_monotonic_ns() - f->received_ns) > dead_ns ? -EIO : 0;
}

static void *run_comedi_force(void *argument)
{
	struct comedi_force *f = argument;
	int fd = comedi_fileno(f->card.device), rc = 0;

	while (!rc && daq_feed_wait(&f->feed, fd, QUIET_MS) != DAQ_STOP) {
		ssize_t got = read(fd, f->block + f->rest, BLOCK_BYTES - f->rest);

		rc = handle_read(f, got < 0 ? -errno : got);
	}
	daq_feed_end(&f->feed, rc,
		     f->restarts > RESTARTS
			     ? "its command ends at once; see dmesg"
			     : "no more valid samples arrive; see dmesg, and start "
			       "again");
	return NULL;
}

static void force_close(struct incise_force *force)
{
	struct comedi_force *f = (struct comedi_force *)force;

	daq_feed_stop(&f->feed);
	card_close(&f->card);
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

static int start_comedi_force(struct comedi_force *f, struct incise_error *err)
{
	struct incise_force_info *info = &f->feed.info;
	int fd = comedi_fileno(f->card.device), rc;

	info->rate_hz = 1e9 / f->card.period_ns;
	info->bits = f->card.bits;
	info->full_scale_V = f->card.full_scale_V;
	info->offset_V = f->card.offset_V;
	snprintf(info->name, sizeof(info->name), "%.36s channel %d, by arrival",
		 comedi_get_board_name(f->card.device), f->card.setup.channel);
	snprintf(info->note, sizeof(info->note), "%s", f->card.note);
	times_init(&f->times, f->card.period_ns);
	rc = daq_feed_init(&f->feed);
	if (!rc && fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK) < 0)
		rc = -errno;
	if (!rc) {
		f->received_ns = incise_monotonic_ns();
		times_start(&f->times, f->received_ns);
		rc = card_start(&f->card);
	}
	if (!rc)
		rc = daq_feed_start(&f->feed, run_comedi_force, f);
	return rc ? incise_error_set(err, -rc, "%s: %s does not start: %s; see dmesg",
				     f->card.where, f->card.path, strerror(-rc))
		  : 0;
}

static void *force_open(const struct incise_backend_request *request,
			struct incise_error *err)
{
	struct comedi_force *f = incise_backend_alloc(sizeof(*f), request->where, err);
	int rc;

	if (!f)
		return NULL;
	f->feed.force.ops = &force_ops;
	f->feed.stop = -1;
	f->card.where = request->where;
	rc = daq_feed_setup(request, &f->card.setup, err);
	rc = rc ? rc : card_open(&f->card, request->arguments, err);
	rc = rc ? rc : start_comedi_force(f, err);
	f->card.where = NULL; /* the caller's */
	if (!rc)
		return &f->feed.force;
	force_close(&f->feed.force);
	errno = -rc;
	return NULL;
}

/* --- search: commands are only tested, nothing is started --- */

#define SECOND_NS 1000000000U

static void describe_comedi_force(const char *path, comedi_t *card,
				  unsigned int subdevice,
				  struct incise_scan_device *device)
{
	int flags = comedi_get_subdevice_flags(card, subdevice);
	int n = comedi_get_n_channels(card, subdevice);
	int bits = bits_of(comedi_get_maxdata(card, subdevice, 0));
	unsigned int chanlist[1] = {CR_PACK(0, 0, AREF_GROUND)};
	double period_ns;
	comedi_cmd command;
	char stable[80], text[100];

	*device = (struct incise_scan_device){0};
	/* /dev/comediN depends on the order of probing; the link names slot or socket. */
	if (!incise_stable_path("/dev/incise/daq/*", path, stable, sizeof(stable)))
		snprintf(stable, sizeof(stable), "%.70s", path);
	snprintf(device->device, sizeof(device->device), "comedi:%s:%u", stable,
		 subdevice);
	snprintf(device->what, sizeof(device->what),
		 "DAQ card %.40s, %d channels of %d bits%s", comedi_get_board_name(card),
		 n, bits, flags & SDF_BUSY ? ", in use" : "");
	incise_scan_tell(device, "path", "%.90s", path);
	incise_scan_tell(device, "board", "%.90s", comedi_get_board_name(card));
	incise_scan_tell(device, "driver", "%.90s", comedi_get_driver_name(card));
	incise_scan_tell(device, "channels", "%d", n);
	incise_scan_tell(device, "bits", "%d", bits);
	list_ranges(card, subdevice, 0, text, sizeof(text));
	incise_scan_tell(device, "ranges_V", "%s", text);
	list_references(flags, text, sizeof(text));
	incise_scan_tell(device, "references", "%s", text);
	/* The shortest accepted period; tests do not disturb a running command. */
	period_ns = command_period(card, subdevice, chanlist, 1, &command);
	device->usable = bits && period_ns > 0;
	if (period_ns > 0)
		incise_scan_tell(device, "rate_most_hz", "%.9g", SECOND_NS / period_ns);
	period_ns = command_period(card, subdevice, chanlist, SECOND_NS, &command);
	if (period_ns > 0)
		incise_scan_tell(device, "rate_least_hz", "%.9g", SECOND_NS / period_ns);
	incise_scan_tell(device, "time_stamps", "by arrival");
}

static int scan_card(const char *path, incise_scan_found *found, void *context)
{
	comedi_t *card = comedi_open(path);
	struct incise_scan_device device;
	int n = card ? comedi_get_n_subdevices(card) : 0, rc = 0;

	for (int i = 0; i < n && !rc; i++)
		if (can_stream(card, (unsigned int)i)) {
			describe_comedi_force(path, card, (unsigned int)i, &device);
			rc = found(context, &device);
		}
	if (card)
		comedi_close(card);
	return rc;
}

static int force_scan(const char *arguments, incise_scan_found *found, void *context,
		      struct incise_error *err)
{
	char pattern[80] = "/dev/comedi[0-9]*";
	glob_t files = {0};
	int rc = 0;

	(void)err;
	/* For "/dev/comedi0:0" the whole card is shown. */
	if (*arguments)
		snprintf(pattern, sizeof(pattern), "%.*s", (int)(strcspn(arguments, ":")),
			 arguments);
	if (!glob(pattern, 0, NULL, &files))
		for (size_t i = 0; i < files.gl_pathc && !rc; i++)
			/* comedi0_subd0 is part of comedi0 */
			if (!strstr(files.gl_pathv[i], "_subd"))
				rc = scan_card(files.gl_pathv[i], found, context);
	globfree(&files);
	return rc;
}

INCISE_BACKEND(incise_force_comedi, "force", "comedi", .open = force_open,
	       .scan = force_scan);
