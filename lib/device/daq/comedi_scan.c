// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Which analog inputs of DAQ cards under comedi can stream. Nothing is started: commands
 * are only tested.
 */
#include <errno.h>
#include <glob.h>
#include <stdio.h>
#include <string.h>
#include "../stable_path.h"
#include "comedi_card.h"
#include "comedi_force.h"

#define SECOND_NS 1000000000U

static void add_ranges(struct incise_scan_device *device, comedi_t *card,
		       unsigned int subdevice)
{
	int n = comedi_get_n_ranges(card, subdevice, 0);
	char text[100] = "";
	size_t used = 0;

	for (int i = 0; i < n && used < sizeof(text); i++) {
		const comedi_range *range =
			comedi_get_range(card, subdevice, 0, (unsigned int)i);

		if (range && range->unit == UNIT_volt)
			used += (size_t)snprintf(text + used, sizeof(text) - used,
						 "%s%.6g to %.6g", used ? ", " : "",
						 range->min, range->max);
	}
	incise_scan_tell(device, "ranges_V", "%s", text);
}

static void describe(const char *path, comedi_t *card, unsigned int subdevice,
		     struct incise_scan_device *device)
{
	int flags = comedi_get_subdevice_flags(card, subdevice);
	int n = comedi_get_n_channels(card, subdevice);
	int bits = comedi_card_bits(comedi_get_maxdata(card, subdevice, 0));
	unsigned int chanlist[1] = {CR_PACK(0, 0, AREF_GROUND)};
	double period_ns;
	comedi_cmd command;
	char stable[80];

	*device = (struct incise_scan_device){0};
	/* /dev/comediN is the order of probing; the link is the slot or socket. */
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
	add_ranges(device, card, subdevice);
	/* The shortest that it takes; tests do not disturb who samples. */
	period_ns = comedi_card_period(card, subdevice, chanlist, 1, &command);
	device->usable = bits && period_ns > 0;
	if (period_ns > 0)
		incise_scan_tell(device, "rate_most_hz", "%.9g", SECOND_NS / period_ns);
	period_ns = comedi_card_period(card, subdevice, chanlist, SECOND_NS, &command);
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
		if (comedi_card_streams(card, (unsigned int)i)) {
			describe(path, card, (unsigned int)i, &device);
			rc = found(context, &device);
		}
	if (card)
		comedi_close(card);
	return rc;
}

int comedi_force_scan(const char *arguments, incise_scan_found *found, void *context,
		      struct incise_error *err)
{
	char pattern[80] = "/dev/comedi[0-9]*";
	glob_t files = {0};
	int rc = 0;

	(void)err;
	/* "/dev/comedi0:0": the whole card is shown. */
	if (*arguments)
		snprintf(pattern, sizeof(pattern), "%.*s", (int)(strcspn(arguments, ":")),
			 arguments);
	if (!glob(pattern, 0, NULL, &files))
		for (size_t i = 0; i < files.gl_pathc && !rc; i++)
			/* comedi0_subd0 is a part of comedi0 */
			if (!strstr(files.gl_pathv[i], "_subd"))
				rc = scan_card(files.gl_pathv[i], found, context);
	globfree(&files);
	return rc;
}
