/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * The simulated ADC from the inside: a waveform that a test feeds, conversions
 * in the hard interrupt of a timer, and a first-in-first-out store from which
 * a thread hands them to IIO.
 *
 *	waveform --convert--> fifo --thread--> IIO's buffer
 *	       |  (hard irq)    |                |
 *	   underruns          lost           overflows
 */
#ifndef INCISE_SIM_ADC_H
#define INCISE_SIM_ADC_H

#include <linux/hrtimer.h>
#include <linux/iio/iio.h>
#include <linux/mutex.h>
#include <linux/spinlock.h>

#include "incise_sim.h"

#define SIM_ADC_FIFO 256

/**
 * struct sim_waveform - samples that are to be converted
 * @sample:	INCISE_SIM_ADC_WAVEFORM of them
 * @head:	samples put in
 * @tail:	samples taken out
 * @cursor:	next sample after @tail, while repeating
 * @repeat:	samples stay and are played again
 * @writer:	one writer at a time
 */
struct sim_waveform {
	u16 *sample;
	u32 head;
	u32 tail;
	u32 cursor;
	bool repeat;
	struct mutex writer; /* one writer at a time */
};

/* One conversion. */
struct sim_conversion {
	s64 t_ns;
	u16 value;
};

/**
 * struct sim_adc - the simulated ADC
 * @lock:	guards all but the writing end of the waveform; taken in hard
 *		interrupts
 * @iio:	what the IIO core sees
 * @trigger:	fires @frequency times per second
 * @timer:	makes it fire
 * @frequency:	conversions per second
 * @waveform:	what is converted
 * @fifo:	conversions on their way to the thread
 * @head:	conversions put into @fifo
 * @tail:	conversions taken out of it
 * @value:	the last conversion
 * @conversions: conversions that ever were
 * @pushed:	of these, those that are in IIO's buffer
 * @overflows:	of these, those that IIO's buffer had no room for
 * @lost:	of these, those that @fifo had no room for
 * @skipped:	periods without a conversion, the timer was late
 * @underruns:	conversions that found no sample and repeated the last one
 * @dir:	the folder in debugfs
 */
struct sim_adc {
	raw_spinlock_t lock;
	struct iio_dev *iio;
	struct iio_trigger *trigger;
	struct hrtimer timer;
	unsigned int frequency;
	struct sim_waveform waveform;
	struct sim_conversion fifo[SIM_ADC_FIFO];
	u32 head;
	u32 tail;
	u16 value;
	u64 conversions;
	u64 pushed;
	u64 overflows;
	u64 lost;
	u64 skipped;
	u64 underruns;
	struct dentry *dir;
};

/* adc.c */
int sim_adc_add(struct sim_adc *adc, struct device *parent);
void sim_adc_remove(struct sim_adc *adc);

/* converter.c */
u16 sim_adc_convert(struct sim_adc *adc);
void sim_adc_convert_to_fifo(struct sim_adc *adc);
bool sim_adc_take(struct sim_adc *adc, struct sim_conversion *conversion);
void sim_adc_start(struct sim_adc *adc);
void sim_adc_files(struct sim_adc *adc, struct dentry *parent);
int sim_adc_init(struct sim_adc *adc);
void sim_adc_free(struct sim_adc *adc);

#endif
