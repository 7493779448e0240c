use springpot::*;
fn main(){
  let sp=Springpot::new;
  for (nm,c,a) in [("sp.2",62740.,0.2),("sp.02",62740.,0.02),("sp.5",62740.,0.5),("sp.9",62740.,0.9),("sp.98",62740.,0.98),("dash",62740.,1.),("spring",62740.,0.),("soft.02",100.,0.02)]{
  let m=Maxwell::new(sp(c,a),&[],Topology::Parallel,0.316).unwrap();
  let rate=1000.; let h=1./rate;
    let k=8.8541878128e-12*4.7*0.04*0.06/(160e-6f64*160e-6);
      let law=Law::<f64>::compressed(&m,Options::at_step(h).with_tolerance(1.0)).unwrap();
      let law32=Law::<f32>::compressed(&m,Options::at_step(h).with_tolerance(1.0)).unwrap();
      let l:Vec<_>=law.memory().modes().map(|m|m.0).collect();
      println!("loss {:.1e} {:.1e} {:.1e} {:.1e}",l[0],l[11],l[12],l[35]);
      let period:Vec<f64>=(0..7000).map(|i|{let v=3000.*(1.-(std::f64::consts::TAU*i as f64*h/7.).cos());k*v*v}).collect();
      let (mut st,mut s32)=(law.state(),law32.state());
      let (mut se,mut sx,mut sxx,mut he,mut worst)=(0.,0.,0.,0.,0f64); let n=86_400_000usize;
      for i in 0..n{ let f=period[i%7000]; let x=law.displacement(&mut st,f); let y=law32.displacement(&mut s32,f as f32) as f64; let e=y-x; se+=e*e;sx+=x;sxx+=x*x;he+=e; if i%3_600_000==3_599_999{ worst=worst.max((he/3.6e6).abs()); he=0.;} }
      let nn=n as f64; let sd=(sxx/nn-(sx/nn).powi(2)).sqrt();
      println!("{nm} rms {:.1e} hourly {:.1e}",(se/nn).sqrt()/sd,worst/sd);
    }
}
