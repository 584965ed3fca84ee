"""STUB until the branch of the codec is merged."""
from __future__ import annotations

import struct
import zlib
from collections import deque
from typing import Literal

import numpy as np

from cosim.config.quantity import Section
from cosim.spikes.viform import WORD, words_for


class CodeSection(Section):
    kind: Literal["layered", "raw"] = "layered"
    cycles: int = 128
    wait: int = 128
class _Sender:
    def __init__(self, section, shape, cycles, rate):
        self.s, self.shape, self.cycles, self.rate = section, shape, cycles, rate
        self.held=[]; self.n=0; self.queue=deque(); self.counts=__import__('types').SimpleNamespace(peak_bytes=0,dropped=0,coded_bytes=0)
    def put(self, data):
        self.held.append(data.words); self.n += data.cycles
        if self.n % self.s.cycles == 0 or self.n == self.cycles:
            w=np.concatenate(self.held); self.held=[]
            first=self.n-((self.n-1)%self.s.cycles+1)
            used=sum(len(p) for _,p in self.queue)
            for r in range(0,self.shape[0],64):
                body=zlib.compress(w[:,r:r+64].tobytes(),1)
                p=struct.pack("<III",first,r,len(w))+body
                if (used+len(p))*8 > self.rate*(self.s.wait+self.s.cycles):
                    self.counts.dropped+=1; continue
                used+=len(p); self.counts.coded_bytes+=len(p); self.queue.append((self.n,p))
            self.counts.peak_bytes=max(self.counts.peak_bytes,used)
    def pop(self, before):
        if self.queue and self.queue[0][0] <= before:
            return self.queue.popleft()[1]
        return None
    def state(self): return {}
    def restore(self, s): pass
class _Decoder:
    def __init__(self, section, shape, cycles):
        self.s,self.shape,self.cycles=section,shape,cycles; self.got={}; self.done=0
    def take(self, p):
        first,r,n=struct.unpack_from("<III",p)
        if first<self.done: return None
        self.got[first,r]=np.frombuffer(zlib.decompress(p[12:]),np.uint32).reshape(n,-1,self.shape[1])
        return min(first+self.s.cycles,self.cycles)
    def read(self, stop):
        first=self.done; self.done=stop
        w=np.zeros((words_for(stop-first),*self.shape),np.uint32)
        rows=range(0,self.shape[0],64); miss=np.zeros((len(rows),1),bool)
        for k,r in enumerate(rows):
            part=self.got.pop((first,r),None)
            if part is None: miss[k]=True
            else: w[:,r:r+64]=part
        return w,miss
def sender_of(section, shape, clock, cycles, rate): return _Sender(section,shape,cycles,rate)
def decoder_of(section, shape, clock, cycles): return _Decoder(section,shape,cycles)
