/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A DAQ card in place of comedilib: the functions of that name here are what the objects
 * under test are linked to. Its file is a pipe that a test fills.
 */
#ifndef INCISE_TEST_DAQ_CARD_H
#define INCISE_TEST_DAQ_CARD_H

#include <comedilib.h>
#include <errno.h>
#include <stdatomic.h>
#include <string.h>
#include <unistd.h>

struct comedi_t_struct {
	int open_error, command_error;
	int type, flags, n_subdevices, n_channels;
	lsampl_t maxdata;
	comedi_range ranges[4];
	int n_ranges;
	unsigned int period_least_ns;
	bool no_timer, convert_timer;
	int buffer_size;
	int pipe[2];
	/* what was done */
	int opened, cancelled;
	atomic_int commands;
	comedi_cmd command;
	unsigned int chanspec;
};

static struct comedi_t_struct card;

static void card_reset(void)
{
	card = (struct comedi_t_struct){
		.type = COMEDI_SUBD_AI,
		.flags = SDF_CMD_READ | SDF_GROUND,
		.n_subdevices = 2,
		.n_channels = 8,
		.maxdata = 4095,
		.ranges = {{-5, 5, UNIT_volt}, {0, 5, UNIT_volt}, {-2.5, 2.5, UNIT_volt}},
		.n_ranges = 3,
		.period_least_ns = 5000,
		.buffer_size = 1 << 20,
		.pipe = {-1, -1},
	};
}

comedi_t *comedi_open(const char *path)
{
	errno = card.open_error;
	card.opened += !card.open_error;
	return card.open_error ? NULL : &card;
}

int comedi_close(comedi_t *c)
{
	c->opened--;
	return 0;
}

int comedi_fileno(comedi_t *c)
{
	return c->pipe[0];
}

int comedi_get_n_subdevices(comedi_t *c)
{
	return c->n_subdevices;
}

const char *comedi_get_driver_name(comedi_t *c)
{
	return "fake";
}

const char *comedi_get_board_name(comedi_t *c)
{
	return "fake-16";
}

int comedi_get_read_subdevice(comedi_t *c)
{
	return 0;
}

int comedi_set_read_subdevice(comedi_t *c, unsigned int subdevice)
{
	return -1;
}

/* Only the first is one. */
int comedi_get_subdevice_type(comedi_t *c, unsigned int subdevice)
{
	return subdevice ? COMEDI_SUBD_DIO : c->type;
}

int comedi_get_subdevice_flags(comedi_t *c, unsigned int subdevice)
{
	return c->flags;
}

int comedi_get_n_channels(comedi_t *c, unsigned int subdevice)
{
	return c->n_channels;
}

lsampl_t comedi_get_maxdata(comedi_t *c, unsigned int subdevice, unsigned int channel)
{
	return c->maxdata;
}

int comedi_get_n_ranges(comedi_t *c, unsigned int subdevice, unsigned int channel)
{
	return c->n_ranges;
}

comedi_range *comedi_get_range(comedi_t *c, unsigned int subdevice, unsigned int channel,
			       unsigned int range)
{
	return range < (unsigned int)c->n_ranges ? &c->ranges[range] : NULL;
}

int comedi_get_buffer_size(comedi_t *c, unsigned int subdevice)
{
	return c->buffer_size;
}

int comedi_get_max_buffer_size(comedi_t *c, unsigned int subdevice)
{
	return 1 << 16;
}

int comedi_set_buffer_size(comedi_t *c, unsigned int subdevice, unsigned int size)
{
	c->buffer_size = (int)size;
	return 0;
}

int comedi_get_cmd_generic_timed(comedi_t *c, unsigned int subdevice, comedi_cmd *command,
				 unsigned int n, unsigned int period_ns)
{
	if (c->no_timer)
		return -1;
	command->scan_begin_src = c->convert_timer ? TRIG_FOLLOW : TRIG_TIMER;
	command->scan_begin_arg = c->convert_timer ? 0 : period_ns;
	command->convert_src = c->convert_timer ? TRIG_TIMER : TRIG_NOW;
	command->convert_arg = c->convert_timer ? period_ns : 0;
	return 0;
}

/* Mends the period: no less than its least, in whole microseconds. */
int comedi_command_test(comedi_t *c, comedi_cmd *command)
{
	unsigned int *ns =
		c->convert_timer ? &command->convert_arg : &command->scan_begin_arg;
	unsigned int is = *ns;

	*ns = *ns < c->period_least_ns ? c->period_least_ns : (*ns + 500) / 1000 * 1000;
	return *ns == is ? 0 : 4;
}

int comedi_command(comedi_t *c, comedi_cmd *command)
{
	errno = c->command_error;
	if (c->command_error)
		return -1;
	c->command = *command;
	c->chanspec = command->chanlist[0];
	atomic_fetch_add(&c->commands, 1);
	return 0;
}

int comedi_cancel(comedi_t *c, unsigned int subdevice)
{
	c->cancelled++;
	return 0;
}

int comedi_poll(comedi_t *c, unsigned int subdevice)
{
	return 0;
}

#endif
