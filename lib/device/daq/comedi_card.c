// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * One analog input of a DAQ card under comedi; see comedi_card.h.
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "comedi_card.h"

#define TOLERANCE 0.01 /* of the rate */
#define WIDE 1.001     /* a range of 4.995 V does for 5 V */
#define RANGES_MAX 32
#define BUFFER_S 2
#define TESTS 5 /* each mends one stage of the command */

int comedi_card_bits(lsampl_t maxdata)
{
	int bits = 0;

	if (maxdata & (maxdata + 1) || maxdata > INT32_MAX)
		return 0;
	for (; maxdata; maxdata >>= 1)
		bits++;
	return bits;
}

int comedi_card_range(const comedi_range *ranges, int n, double full_scale_V)
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

bool comedi_card_streams(comedi_t *device, unsigned int subdevice)
{
	int flags = comedi_get_subdevice_flags(device, subdevice);

	return comedi_get_subdevice_type(device, subdevice) == COMEDI_SUBD_AI &&
	       flags >= 0 && flags & SDF_CMD_READ;
}

double comedi_card_period(comedi_t *device, unsigned int subdevice,
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
	/* One channel: scans follow each other as its conversions do. */
	return command->convert_src == TRIG_TIMER ? command->convert_arg : 0;
}

static int card_error(const struct comedi_card *card, int code, const char *what,
		      struct incise_error *err)
{
	return incise_error_set(err, code, "%s: %s: %s: %s; see `comedi_board_info %s`",
				card->where, card->path, what, strerror(code),
				card->path);
}

/* "/dev/comedi0:1"; -1 in @subdevice where none is named. */
static int parse(struct comedi_card *card, const char *arguments, int *subdevice,
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

static int open_device(struct comedi_card *card, struct incise_error *err)
{
	int code;

	errno = 0;
	card->device = comedi_open(card->path);
	if (card->device)
		return 0;
	code = errno ? errno : ENODEV;
	if (code == EACCES || code == EPERM)
		return incise_error_set(err, EACCES,
					"%s: may not open %s; join the group that may "
					"(udev/ has the rules), or be root",
					card->where, card->path);
	return incise_error_set(err, code,
				"%s: %s: %s; load the driver of your card, and "
				"comedi_config where it does not set up itself",
				card->where, card->path, strerror(code));
}

static int take_subdevice(struct comedi_card *card, int asked, struct incise_error *err)
{
	int n = comedi_get_n_subdevices(card->device), flags;

	for (int i = 0; i < n && asked < 0; i++)
		if (comedi_card_streams(card->device, (unsigned int)i))
			asked = i;
	if (asked < 0 || asked >= n ||
	    !comedi_card_streams(card->device, (unsigned int)asked))
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: %s: subdevice %d is no analog input that samples by "
			"itself; see `comedi_board_info -v %s`",
			card->where, card->path, asked, card->path);
	card->subdevice = (unsigned int)asked;
	flags = comedi_get_subdevice_flags(card->device, card->subdevice);
	if (flags & SDF_BUSY)
		return incise_error_set(err, EBUSY,
					"%s: %s is in use by another program; end it",
					card->where, card->path);
	card->wide = flags & SDF_LSAMPL;
	card->reference = flags & SDF_GROUND   ? AREF_GROUND
			  : flags & SDF_COMMON ? AREF_COMMON
			  : flags & SDF_DIFF   ? AREF_DIFF
					       : AREF_OTHER;
	/* A file reads one subdevice; another than the first one must be named. */
	if (comedi_get_read_subdevice(card->device) != asked &&
	    comedi_set_read_subdevice(card->device, card->subdevice) < 0)
		return card_error(card, EOPNOTSUPP, "this subdevice cannot be read", err);
	return 0;
}

static int no_range(const struct comedi_card *card, const comedi_range *ranges, int n,
		    struct incise_error *err)
{
	char known[200] = "none";
	size_t used = 0;

	for (int i = 0; i < n && used < sizeof(known); i++)
		used += (size_t)snprintf(known + used, sizeof(known) - used,
					 "%s%.6g to %.6g", i ? ", " : "", ranges[i].min,
					 ranges[i].max);
	return incise_error_set(err, ERANGE,
				"%s: %s has no range of %.6g V; set "
				"force_setup.full_scale_V (ranges in V: %s)",
				card->where, card->path, card->setup.full_scale_V, known);
}

static int take_channel(struct comedi_card *card, struct incise_error *err)
{
	unsigned int channel = (unsigned int)card->setup.channel;
	int n = comedi_get_n_channels(card->device, card->subdevice), range;
	comedi_range ranges[RANGES_MAX] = {0};
	lsampl_t maxdata;

	if (card->setup.channel < 0 || card->setup.channel >= n)
		return incise_error_set(err, EINVAL,
					"%s: %s has channels 0 to %d; correct "
					"force_setup.channel",
					card->where, card->path, n - 1);
	maxdata = comedi_get_maxdata(card->device, card->subdevice, channel);
	card->bits = comedi_card_bits(maxdata);
	if (!card->bits)
		return incise_error_set(err, EOPNOTSUPP,
					"%s: %s: codes up to %u are not those of a "
					"converter of 1 to 31 bits",
					card->where, card->path, maxdata);
	n = comedi_get_n_ranges(card->device, card->subdevice, channel);
	n = n < RANGES_MAX ? n : RANGES_MAX;
	for (int i = 0; i < n; i++) {
		comedi_range *one = comedi_get_range(card->device, card->subdevice,
						     channel, (unsigned int)i);

		ranges[i] = one ? *one : (comedi_range){.unit = UNIT_none};
	}
	range = comedi_card_range(ranges, n, card->setup.full_scale_V);
	if (range < 0 || ranges[range].unit != UNIT_volt ||
	    !(ranges[range].max > ranges[range].min))
		return no_range(card, ranges, n, err);
	card->range = (unsigned int)range;
	/* Its highest code is the top of the range; a full scale is one code more. */
	card->full_scale_V =
		(ranges[range].max - ranges[range].min) / maxdata * ((double)maxdata + 1);
	card->offset_V = ranges[range].min;
	card->chanlist[0] = CR_PACK(channel, card->range, card->reference);
	return 0;
}

static int take_rate(struct comedi_card *card, struct incise_error *err)
{
	double asked_ns = 1e9 / card->setup.rate_hz;
	int want;

	card->period_ns =
		comedi_card_period(card->device, card->subdevice, card->chanlist,
				   (unsigned int)lround(asked_ns), &card->command);
	if (card->period_ns <= 0)
		return incise_error_set(
			err, EOPNOTSUPP,
			"%s: %s takes no command that samples by a timer; "
			"use another card",
			card->where, card->path);
	if (fabs(card->period_ns - asked_ns) > asked_ns * TOLERANCE)
		return incise_error_set(
			err, EINVAL,
			"%s: %s does not take %.9g Hz, next to it is %.9g "
			"Hz; set force_setup.rate_hz",
			card->where, card->path, card->setup.rate_hz,
			1e9 / card->period_ns);
	/* More than it has is refused, and what it has must do. */
	want = (int)(card->setup.rate_hz * BUFFER_S) * (card->wide ? 4 : 2);
	if (comedi_get_buffer_size(card->device, card->subdevice) < want) {
		int most = comedi_get_max_buffer_size(card->device, card->subdevice);

		comedi_set_buffer_size(card->device, card->subdevice,
				       (unsigned int)(want < most ? want : most));
	}
	return 0;
}

int comedi_card_open(struct comedi_card *card, const char *arguments,
		     struct incise_error *err)
{
	int subdevice, rc = parse(card, arguments, &subdevice, err);

	rc = rc ? rc : open_device(card, err);
	rc = rc ? rc : take_subdevice(card, subdevice, err);
	rc = rc ? rc : take_channel(card, err);
	return rc ? rc : take_rate(card, err);
}

int comedi_card_start(struct comedi_card *card)
{
	comedi_cmd command = card->command;

	errno = 0;
	if (comedi_command(card->device, &command) >= 0)
		return 0;
	return errno ? -errno : -EIO;
}

void comedi_card_close(struct comedi_card *card)
{
	if (!card->device)
		return;
	comedi_cancel(card->device, card->subdevice);
	comedi_close(card->device);
	card->device = NULL;
}
