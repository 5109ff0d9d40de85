/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * One analog input of a DAQ card under comedi: which subdevice, channel and range, and the
 * command that samples it.
 */
#ifndef INCISE_COMEDI_CARD_H
#define INCISE_COMEDI_CARD_H

#include <comedilib.h>
#include <incise/backend.h>

struct comedi_card {
	const char *where; /* begins each line; while it is set up */
	struct incise_force_setup setup;
	char path[80];
	comedi_t *device;
	unsigned int subdevice, range, reference;
	unsigned int chanlist[1];
	comedi_cmd command;
	bool wide; /* samples of 4 bytes, else 2 */
	int bits;
	double full_scale_V, offset_V;
	double period_ns; /* that the card takes */
};

/*
 * "/dev/comedi0:0"; without ":0" the first analog input that takes commands. 0 or -errno
 * with the line in @err; comedi_card_close() is due in either case.
 */
int comedi_card_open(struct comedi_card *card, const char *arguments,
		     struct incise_error *err);
void comedi_card_close(struct comedi_card *card);

/* Start sampling. 0 or -errno. */
int comedi_card_start(struct comedi_card *card);

/*
 * The period that the card would take for one of @ns, for one channel; 0: it has no timer.
 * Fills in @command, but for its channel.
 */
double comedi_card_period(comedi_t *device, unsigned int subdevice,
			  unsigned int *chanlist, unsigned int ns, comedi_cmd *command);

/* Whether a subdevice is an analog input that streams. */
bool comedi_card_streams(comedi_t *device, unsigned int subdevice);

/* Of @maxdata, codes 0 … maxdata; 0: not what a converter has. */
int comedi_card_bits(lsampl_t maxdata);

/*
 * The range to choose for @full_scale_V: the narrowest that is as wide, of two such ones
 * that which begins higher (0 … 5 V before ±2.5 V); its number, or -1. 0 V: the first.
 */
int comedi_card_range(const comedi_range *ranges, int n, double full_scale_V);

#endif
